"""How well a task is done: one episode in each world, measured a control step at a time."""

import dataclasses
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
from murmillo.cli.tasks.success import StyleSuccess
from murmillo.cli.tasks.world import World
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.metrics.tasks import heading_cosine, normalised_return, reach_error
from murmillo.envs.tasks.reach import Reach
from murmillo.envs.tasks.steering import Steering

Goals = dict[str, Tensor]
Figures = dict[str, Value]
"""What was measured of one player, by name; see `cli/tasks/table.py`."""


class Measured(NamedTuple):
    """What was measured.

    Attributes:
        all: figures of each player.
        styles: the same of the episodes of one commanded style, by player and style; empty where none is commanded.
    """

    all: dict[str, Figures]
    styles: dict[str, dict[str, Figures]]


def measure(
    config: TaskTrainConfig, below: LowRun | None, checkpoint: Path, worlds: int, seed: int = 12345
) -> Measured:
    """Figures of each player: the same episodes as far as they depend on the seed, without exploration.

    A commanded style holds for an episode (CALM, section 8.2.1).

    Raises:
        AgentError: the checkpoint is missing or does not fit.
        CommandError, SuiteError: the low-level run or the environment cannot be used.
    """
    if config.commands_styles:
        config = dataclasses.replace(config, task=dataclasses.replace(config.task, skill_steps=0))
    world = World(config, below, worlds)
    try:
        recorder = Recorder(world.env, StyleSuccess(world.env) if config.commands_styles else None)
        world.observe(recorder)
        measured = Measured({}, {})
        for name, player in make_players(config, world, checkpoint).items():
            measured.all[name], measured.styles[name] = _play(world, player, recorder, seed)
        return measured
    finally:
        world.close()


@torch.no_grad()
def _play(world: World, player: Player, recorder: "Recorder", seed: int) -> tuple[Figures, dict[str, Figures]]:
    """Figures of all episodes, and of those of each commanded style."""
    obs, _ = world.decisions.reset(seed=seed)
    recorder.begin(obs)
    while recorder.going:
        obs, *_ = world.step(player(tensors(obs)))
    return recorder.figures(), recorder.figures_by_style()


class Recorder:
    """Keeps the first episode of each world, control step by control step: `begin`, then a call after each."""

    def __init__(self, env: HumanoidVectorEnv, style: StyleSuccess | None = None) -> None:
        """`style` is asked too, where one is commanded."""
        self._env, self._style = env, style
        self._own = next((own for kind, own in _OWN.items() if isinstance(env.task, kind)), None)

    def begin(self, obs: Any) -> None:
        """The episodes begin now, with these observations."""
        n = self._env.num_envs
        # whether the first episode lasts, at the beginning and after each control step
        self._alive = [torch.ones(n, dtype=torch.bool)]
        self._fell = torch.zeros(n, dtype=torch.bool)
        self._early = torch.zeros(n, dtype=torch.bool)
        self._rewards: list[Tensor] = []
        self._pairs: list[tuple[Tensor, Tensor]] = []
        self._goals = self._current_goals()
        if self._style is not None:
            self._style.begin(obs)

    @property
    def lasting(self) -> Tensor:
        """`[N]` bool: the worlds whose first episode still lasts."""
        return self._alive[-1]

    @property
    def going(self) -> bool:
        """Whether an episode still lasts."""
        return bool(self.lasting.any())

    def __call__(self, action: Tensor, results: Any) -> None:
        _, reward, terminated, truncated, infos = results
        alive, ended = self._alive[-1], torch.as_tensor(terminated)
        low = self._env.task.reward_range[0]
        self._rewards.append(torch.where(alive, torch.as_tensor(reward), low))
        self._early |= alive & ended
        self._fell |= alive & torch.as_tensor(infos["fall"])
        self._alive.append(alive & ~ended & ~torch.as_tensor(truncated))
        if self._own is not None:
            actual, asked = self._own.pair(self._env, self._goals)
            self._pairs.append((actual.clone(), asked))
        self._goals = self._current_goals()
        if self._style is not None:
            self._style.step(infos["final_obs"])

    def figures(self) -> Figures:
        n, steps = self._env.num_envs, self._env.config.episode_steps
        length = torch.stack(self._alive[:-1]).sum(0).float()
        rewards = torch.stack(self._rewards, dim=-1)[:, :steps]
        low, high = self._env.task.reward_range
        if (rest := steps - rewards.shape[1]) > 0:
            rewards = torch.cat((rewards, torch.full((n, rest), low)), dim=-1)
        returns = normalised_return(rewards, low, high)
        return {
            "normalised_return": _value(returns.mean, n, returns.deviation, "episodes"),
            "length": Value(length.mean().item(), n),
            "fall_rate": Value(self._fell.float().mean().item(), n),
            "early_rate": Value(self._early.float().mean().item(), n),
            **self._done_as_told(torch.ones(n, dtype=torch.bool)),
        }

    def figures_by_style(self) -> dict[str, Figures]:
        """How well the episodes of each commanded style did what they were told."""
        if self._style is None:
            return {}
        commanded = self._style.skill
        return {self._env.skills[k]: self._done_as_told(commanded == k) for k in commanded.unique().tolist()}

    def _done_as_told(self, worlds: Tensor) -> Figures:
        """Figures of the task's own and of the style, over all control steps of these worlds [N] bool."""
        found: Figures = {}
        alive = torch.stack(self._alive) & worlds
        if self._own is not None:
            # where an episode has just ended, the state is already that of the next one
            found |= self._own.judge(*(torch.stack(parts)[alive[1:]] for parts in zip(*self._pairs, strict=True)))
        if self._style is not None:
            right = self._style.steps()[alive[:-1].T]
            found["style_success"] = Value(right.float().mean().item(), len(right))
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
