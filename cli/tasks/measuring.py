"""How well a task is done: one episode in each world, measured a control step at a time."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor

from murmillo.agents.common.rollout import tensors
from murmillo.cli.evaluation.figures import Value
from murmillo.cli.tasks.config import TaskTrainConfig
from murmillo.cli.tasks.low import LowRun
from murmillo.cli.tasks.players import Player, make_players
from murmillo.cli.tasks.world import World
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.metrics.tasks import heading_cosine, normalised_return, reach_error
from murmillo.envs.tasks.reach import Reach
from murmillo.envs.tasks.steering import Steering

Goals = dict[str, Tensor]
Figures = dict[str, Value]
"""What was measured of one player, by name; see `cli/tasks/table.py`."""


def measure(
    config: TaskTrainConfig, below: LowRun | None, checkpoint: Path, worlds: int, seed: int = 12345
) -> dict[str, Figures]:
    """Figures of each player: the same episodes as far as they depend on the seed, without exploration.

    Raises:
        AgentError: the checkpoint is missing or does not fit.
        CommandError, SuiteError: the low-level run or the environment cannot be used.
    """
    world = World(config, below, worlds)
    try:
        recorder = _Recorder(world.env)
        world.observe(recorder)
        return {
            name: _play(world, player, recorder, seed)
            for name, player in make_players(config, world, checkpoint).items()
        }
    finally:
        world.close()


@torch.no_grad()
def _play(world: World, player: Player, recorder: "_Recorder", seed: int) -> Figures:
    obs, _ = world.decisions.reset(seed=seed)
    recorder.begin()
    while recorder.going:
        obs, *_ = world.step(player(tensors(obs)))
    return recorder.figures()


class _Recorder:
    """Keeps the first episode of each world, control step by control step."""

    def __init__(self, env: HumanoidVectorEnv) -> None:
        self._env = env
        self._own = next((own for kind, own in _OWN.items() if isinstance(env.task, kind)), None)

    def begin(self) -> None:
        """The episodes begin now."""
        n = self._env.num_envs
        self._alive = torch.ones(n, dtype=torch.bool)
        self._length = torch.zeros(n)
        self._fell = torch.zeros(n, dtype=torch.bool)
        self._early = torch.zeros(n, dtype=torch.bool)
        self._rewards: list[Tensor] = []
        self._pairs: list[tuple[Tensor, Tensor]] = []
        self._goals = self._current_goals()

    @property
    def going(self) -> bool:
        """Whether an episode still lasts."""
        return bool(self._alive.any())

    def __call__(self, action: Tensor, results: Any) -> None:
        _, reward, terminated, truncated, infos = results
        alive, ended = self._alive, torch.as_tensor(terminated)
        low = self._env.task.reward_range[0]
        self._rewards.append(torch.where(alive, torch.as_tensor(reward), low))
        self._length += alive
        self._early |= alive & ended
        self._fell |= alive & torch.as_tensor(infos["fall"])
        self._alive = alive & ~ended & ~torch.as_tensor(truncated)
        # where an episode has just ended, the state is already that of the next one
        if self._own is not None:
            actual, asked = self._own.pair(self._env, self._goals)
            self._pairs.append((actual[self._alive], asked[self._alive]))
        self._goals = self._current_goals()

    def figures(self) -> Figures:
        n, steps = len(self._length), self._env.config.episode_steps
        rewards = torch.stack(self._rewards, dim=-1)[:, :steps]
        low, high = self._env.task.reward_range
        if (rest := steps - rewards.shape[1]) > 0:
            rewards = torch.cat((rewards, torch.full((n, rest), low)), dim=-1)
        returns = normalised_return(rewards, low, high)
        found = {
            "normalised_return": _value(returns.mean, n, returns.deviation, "episodes"),
            "length": Value(self._length.mean().item(), n),
            "fall_rate": Value(self._fell.float().mean().item(), n),
            "early_rate": Value(self._early.float().mean().item(), n),
        }
        if self._own is not None:
            found |= self._own.judge(*(torch.cat(parts) for parts in zip(*self._pairs, strict=True)))
        return found

    def _current_goals(self) -> Goals:
        """Those that the next step is rewarded by."""
        return {name: goal.clone() for name, goal in getattr(self._env.task, "goals", {}).items()}


class _Own(NamedTuple):
    """A measure of a task's own.

    Attributes:
        pair: what is and what is asked for after a step, each [N, ...] in the world.
        judge: figures of these in all steps [M, ...].
    """

    pair: Callable[[HumanoidVectorEnv, Goals], tuple[Tensor, Tensor]]
    judge: Callable[[Tensor, Tensor], Figures]


def _tip_and_target(env: HumanoidVectorEnv, goals: Goals) -> tuple[Tensor, Tensor]:
    assert isinstance(env.task, Reach)
    tip = env.character.key_bodies.index(env.task.config.key_body)
    return env.state.key_pos_w[:, tip], goals["target_w"]


def _velocity_and_direction(env: HumanoidVectorEnv, goals: Goals) -> tuple[Tensor, Tensor]:
    return env.state.qvel[:, :2], goals["direction_w"]


def _judge_reach(tip: Tensor, target: Tensor) -> Figures:
    error = reach_error(tip, target)
    return {"reach_error": _value(error.mean, error.count, error.deviation, "control steps")}


def _judge_heading(velocity: Tensor, direction: Tensor) -> Figures:
    return {"heading_cosine": Value(heading_cosine(velocity, direction), len(velocity))}


_OWN = {Reach: _Own(_tip_and_target, _judge_reach), Steering: _Own(_velocity_and_direction, _judge_heading)}
"""By the task, or what it is derived from."""


def _value(mean: float, count: int, deviation: float, of: str) -> Value:
    """A mean with the standard deviation of single ones, which one alone does not have."""
    return Value(mean, count, deviation, f"single {of}") if count > 1 else Value(mean, count)
