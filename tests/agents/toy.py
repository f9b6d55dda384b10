"""A vector environment for tests: point masses on a plane, whose demonstrations move straight at one speed."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from murmillo.agents.ase.agent import ASE
from murmillo.agents.ase.config import ASEConfig
from murmillo.agents.calm.agent import CALM
from murmillo.agents.calm.config import CALMConfig, EncoderConfig
from murmillo.agents.case.agent import CASE
from murmillo.agents.case.config import CASEConfig
from murmillo.agents.common.discriminator import DiscriminatorConfig
from murmillo.agents.common.interface import Agent
from murmillo.agents.common.ppo import PPOConfig
from murmillo.agents.common.runner import Runner, RunnerConfig

SPEED = 0.6
DT = 0.1
MOTION_FRAMES = 6
"""Length of the motions that the small CALM encodes."""


class PointMass(VectorEnv):
    """State: position and velocity, `[N, 4]`. Action: the velocity to approach, `[N, 2]`.

    Reward: minus the distance of the speed from that of the demonstrations. Terminates far from the origin, truncates
    after `episode_steps`. `infos["final_obs"]` holds the true successors of all worlds, as arrays.

    The demonstrations of skill c of K move into the c-th of K equal sectors; those of the one skill move anywhere.
    With `heights` there is a map to be seen, with numbers that mean nothing.
    """

    def __init__(
        self,
        num_envs: int,
        window: int = 3,
        episode_steps: int = 16,
        bound: float = 1.2,
        skills: int = 1,
        heights: bool = False,
    ) -> None:
        self.heights = heights
        self.num_envs = num_envs
        self.skills = skills
        self.skill = np.zeros(num_envs, np.int64)
        self.skill_weights = torch.ones(skills)
        self.ground_contact = True
        self.window = window
        self.episode_steps = episode_steps
        self.bound = bound
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        self.single_observation_space = spaces.Dict(
            {
                "state": spaces.Box(-np.inf, np.inf, (4,), np.float32),
                "skill": spaces.Discrete(skills),
                "window": spaces.Box(-np.inf, np.inf, (window, 4), np.float32),
                **({"heights": spaces.Box(-np.inf, np.inf, (35, 35), np.float32)} if heights else {}),
            }
        )
        self.single_action_space = spaces.Box(-1, 1, (2,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.history = np.zeros((num_envs, window, 4), np.float32)
        self.clock = np.zeros(num_envs, np.int64)
        self.rng = torch.Generator()

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        if seed is not None:
            self.rng.manual_seed(seed)
        self._begin(np.ones(self.num_envs, bool))
        return self._obs(), {}

    def step(self, actions: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict]:
        state = self.history[:, -1]
        velocity = 0.5 * state[:, 2:] + 0.5 * np.clip(actions, -1, 1)
        position = state[:, :2] + DT * velocity
        self.history = np.concatenate([self.history[:, 1:], np.hstack([position, velocity])[:, None]], 1)
        self.clock += 1
        reward = -np.abs(np.linalg.norm(velocity, axis=1) - SPEED)
        terminated = np.abs(position).max(1) > self.bound
        truncated = ~terminated & (self.clock >= self.episode_steps)
        infos = {"final_obs": self._obs()}
        self._begin(terminated | truncated)
        return self._obs(), reward, terminated, truncated, infos

    def _begin(self, worlds: np.ndarray) -> None:
        start = np.zeros((int(worlds.sum()), 4), np.float32)
        start[:, :2] = torch.rand(len(start), 2, generator=self.rng).numpy() - 0.5
        self.history[worlds] = start[:, None]
        self.clock[worlds] = 0
        if self.skills > 1 and len(start):
            drawn = torch.multinomial(self.skill_weights, len(start), replacement=True, generator=self.rng)
            self.skill[worlds] = drawn.numpy()

    def set_skill_weights(self, weights: Tensor) -> None:
        self.skill_weights = weights

    def set_ground_contact(self, allowed: bool) -> None:
        self.ground_contact = allowed

    def _obs(self) -> dict[str, np.ndarray]:
        window = self.history.copy()
        seen = {"state": window[:, -1], "skill": self.skill.copy(), "window": window}
        if self.heights:
            cells = np.arange(35 * 35, dtype=np.float32)
            seen["heights"] = np.sin(cells * (1 + window[:, -1, :1])).reshape(-1, 35, 35)
        return seen

    def demonstrations(
        self,
        n: int,
        generator: torch.Generator,
        skill: Tensor | None = None,
        frames: int | None = None,
        rows: Tensor | slice | None = None,
    ) -> dict[str, Tensor]:
        if skill is None:
            skill = torch.randint(self.skills, (n,), generator=generator) if self.skills > 1 else torch.zeros(n).long()
        angle = 2 * torch.pi / self.skills * (skill[:, None] + torch.rand(n, 1, generator=generator))
        velocity = SPEED * torch.cat([angle.cos(), angle.sin()], 1)
        start = torch.rand(n, 2, generator=generator) - 0.5
        times = DT * torch.arange(frames or self.window)
        position = start[:, None] + times[None, :, None] * velocity[:, None]
        window = torch.cat([position, velocity[:, None].expand_as(position)], 2)
        drawn = {"window": window, "skill": skill}
        return drawn if rows is None else {name: value[rows] for name, value in drawn.items()}

    def imitation_pairs(self, n: int, generator: torch.Generator) -> dict[str, Tensor]:
        drawn = self.demonstrations(n, generator)
        state = drawn["window"][:, -1]
        return {"state": state, "skill": drawn["skill"], "action": state[:, 2:]}

    def state_dict(self) -> dict[str, Tensor]:
        return {
            "history": torch.from_numpy(self.history.copy()),
            "clock": torch.from_numpy(self.clock.copy()),
            "skill": torch.from_numpy(self.skill.copy()),
            "rng": self.rng.get_state(),
        }

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        self.history = state["history"].numpy().copy()
        self.clock = state["clock"].numpy().copy()
        self.skill = state["skill"].numpy().copy()
        self.rng.set_state(state["rng"])


def small_ase(**changes: Any) -> ASEConfig:
    """ASE with networks and steps that fit the toy."""
    ppo = PPOConfig(
        hidden=(32, 32),
        style_hidden=(),
        std=0.1,
        policy_learning_rate=1e-3,
        value_learning_rate=3e-3,
        epochs=4,
        minibatch=128,
    )
    discriminator = DiscriminatorConfig(
        hidden=(32, 32), learning_rate=1e-3, minibatch=64, updates=8, gradient_penalty=1.0, replay_size=1000
    )
    fields = {"latent_dim": 4, "latent_steps": (1, 32), "window": 3, "ppo": ppo, "discriminator": discriminator}
    return ASEConfig(**{**fields, **changes})


def make_ase(env: PointMass, generator: torch.Generator, **changes: Any) -> ASE:
    return ASE(env, env.demonstrations, small_ase(**changes), generator)


def small_case(**changes: Any) -> CASEConfig:
    """C·ASE with networks and steps that fit the toy, focal sampling from the first iteration and no curriculum."""
    ase = small_ase()
    fields = {
        "latent_dim": ase.latent_dim,
        "latent_steps": ase.latent_steps,
        "label_dim": 8,
        "window": ase.window,
        "encoder_hidden": (32, 32),
        "focal_start": 0,
        "upright_iterations": 0,
        "ppo": ase.ppo,
        "discriminator": dataclasses.replace(ase.discriminator, dropout=0.2),
    }
    return CASEConfig(**{**fields, **changes})


def make_case(env: PointMass, generator: torch.Generator, **changes: Any) -> CASE:
    return CASE(env, env.demonstrations, small_case(**changes), generator)


def small_calm(**changes: Any) -> CALMConfig:
    """CALM with networks and steps that fit the toy."""
    ase = small_ase()
    fields = {
        "latent_dim": ase.latent_dim,
        "latent_steps": (4, 16),
        "window": ase.window,
        "discriminator_style_hidden": (),
        "ppo": ase.ppo,
        "discriminator": ase.discriminator,
        "encoder": EncoderConfig(frames=MOTION_FRAMES, hidden=(32, 32), shift=2, minibatch=64, pool=256),
    }
    return CALMConfig(**{**fields, **changes})


def make_calm(env: PointMass, generator: torch.Generator, **changes: Any) -> CALM:
    return CALM(env, env.demonstrations, small_calm(**changes), generator)


def make_runner(
    folder: Any,
    *,
    make: Callable[..., Agent] = make_ase,
    num_envs: int = 32,
    skills: int = 1,
    seed: int = 0,
    agent: dict | None = None,
    **config: Any,
) -> Runner:
    """A runner of a small agent on the toy; `agent` changes the agent's config, the rest the runner's."""
    generator = torch.Generator().manual_seed(seed)
    env = PointMass(num_envs, skills=skills)
    settings = RunnerConfig(**{"samples": 32 * 8 * 4, "horizon": 8, "lam": 0.9, "gamma": 0.9, **config})
    return Runner(env, make(env, generator, **(agent or {})), settings, generator, folder)


def equal(a: object, b: object) -> bool:
    """Whether two nested states are the same, bit for bit."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(equal(a[key], b[key]) for key in a)
    if isinstance(a, torch.Tensor) and isinstance(b, torch.Tensor):
        return a.dtype == b.dtype and torch.equal(a, b)
    return a == b
