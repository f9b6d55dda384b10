"""The environment under noise: what a step of it takes, and how much of that is the physics."""

import copy
import time
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
import torch

from murmillo.cli.benching.turns import Rates
from murmillo.cli.versions import usable_cores
from murmillo.envs import EnvConfig, HumanoidVectorEnv
from murmillo.envs.tasks import Task

NOISE = 0.2
"""Half width of the uniform actions; the character falls within a second, as an untrained policy does."""
WARM_UP = 60
"""Steps until the worlds' episodes are out of step, and as many lie on the ground as in training."""
PHYSICS = "physics step"
ENVIRONMENT = "environment step"
_WARMED = 251
"""Worlds that are warmed up and copied: a prime, so that no table of an environment's state is as long by chance."""
_LOOKED_AT = 64


def noise(env: HumanoidVectorEnv, seed: int) -> np.ndarray:
    """Actions `[N, A]` of the worlds, equal for equal seeds."""
    return uniform((env.num_envs, *(env.single_action_space.shape or ())), seed)


def uniform(shape: tuple[int, ...], seed: int) -> np.ndarray:
    """float32 in [-NOISE, NOISE]."""
    return np.random.default_rng(seed).uniform(-NOISE, NOISE, shape).astype(np.float32)


def make_warm(
    num_envs: int,
    config: EnvConfig | None = None,
    task: Task | None = None,
    state: Mapping[str, Any] | None = None,
) -> HumanoidVectorEnv:
    """An environment in the midst of its episodes; by default the one that ASE trains on.

    Its worlds begin as copies of a few: noise drives them apart, and environments of all sizes meet the same states.

    Args:
        state: of `warm_state` with equal settings, where several environments share one.

    Raises:
        SuiteError: the settings, the number of worlds or the task cannot be.
    """
    config = config or EnvConfig(window=10)
    state = state or warm_state(config, copy.deepcopy(task))  # a task belongs to one environment
    env = HumanoidVectorEnv(num_envs, config, task)
    env.reset(seed=0)
    env.load_state_dict(_copied(state, num_envs))
    return env


def warm_state(config: EnvConfig, task: Task | None = None) -> dict[str, Any]:
    """The state of `_WARMED` worlds whose episodes are out of step."""
    env = HumanoidVectorEnv(_WARMED, config, task)
    env.reset(seed=0)
    for step in range(WARM_UP):
        env.step(noise(env, step))
    state = env.state_dict()
    env.close()
    return state


def _copied(state: Mapping[str, Any], num_envs: int) -> dict[str, Any]:
    """The state of so many worlds from that of `_WARMED`; what is no world's own stays."""
    worlds = torch.arange(num_envs) % _WARMED
    copied: dict[str, Any] = {}
    for name, value in state.items():
        if isinstance(value, Mapping):
            copied[name] = _copied(value, num_envs)
        elif isinstance(value, torch.Tensor) and value.shape[:1] == (_WARMED,):
            copied[name] = value[worlds.to(value.device)]
        else:
            copied[name] = value
    return copied


class Stepping:
    """Steps of an environment, timed; a contestant of `turns`.

    A turn gives control steps a second, summed over the worlds, of the physics alone and of the environment.
    """

    def __init__(self, env: HumanoidVectorEnv, steps: int, label: str = "") -> None:
        """
        Args:
            env: warm.
            steps: of every world a turn.
            label: behind the names of its figures.
        """
        self.env = env
        self.steps = steps
        self.label = label
        self._count = WARM_UP
        self._physics_seconds = 0.0
        self._step_physics = env.physics.step
        env.physics.step = self._timed  # type: ignore[method-assign]

    def turn(self) -> Rates:
        torch.set_num_threads(self.env.config.threads or usable_cores())  # as a training with so many has it
        seconds = self._physics_seconds = 0.0
        for _ in range(self.steps):
            action = noise(self.env, self._count)
            self._count += 1
            self.before_step(action)
            given = torch.as_tensor(action, device=self.env.device) if self.env.config.tensors else action
            begin = self._now()
            self.env.step(given)
            seconds += self._now() - begin
        samples = self.env.num_envs * self.steps
        return {
            PHYSICS + self.label: samples / self._physics_seconds,
            ENVIRONMENT + self.label: samples / seconds,
        }

    def before_step(self, action: np.ndarray) -> None:
        """Called outside the time that is measured."""

    def close(self) -> None:
        self.env.close()

    def _timed(self, *arguments: torch.Tensor) -> None:
        begin = self._now()
        self._step_physics(*arguments)
        self._physics_seconds += self._now() - begin

    def _now(self) -> float:
        """[s], after all that a GPU has been told to do."""
        if self.env.state.qpos.is_cuda:
            torch.cuda.synchronize()
        return time.perf_counter()


def physics_of(env: HumanoidVectorEnv) -> str:
    """Time step, substeps, degrees of freedom and mean contacts a world, in words."""
    model = env.scene.model
    return describe_physics(model.opt.timestep, env.character.substeps, model.nv, mean_contacts(env))


def describe_physics(timestep: float, substeps: int, dof: int, contacts: float | None = None) -> str:
    """As the tables have it; without contacts where they cannot be read."""
    text = f"{substeps} x 1/{1 / timestep:.0f} s, {dof} DoF"
    return text if contacts is None else f"{text}, {contacts:.1f} contacts"


def mean_contacts(env: HumanoidVectorEnv) -> float:
    """Contacts of a world as it stands now, the mean of some."""
    model, state = env.scene.model, env.state
    data = mujoco.MjData(model)
    qpos = torch.cat([state.qpos, state.prop_qpos.flatten(1)], 1)[:_LOOKED_AT].cpu().numpy()
    found = []
    for row in qpos:
        data.qpos[:] = row
        mujoco.mj_fwdPosition(model, data)
        found.append(data.ncon)
    return float(np.mean(found))
