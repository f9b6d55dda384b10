"""Who plays a task when it is measured: the trained policy, and what it is to be better than."""

from collections.abc import Callable
from pathlib import Path

import torch
from torch import Tensor

from murmillo.agents.common.interface import Obs
from murmillo.agents.common.task_agent import TaskAgent
from murmillo.cli.tasks.config import TaskTrainConfig
from murmillo.cli.tasks.world import World, load_policy, make_policy

TRAINED, UNTRAINED, RANDOM = "trained", "untrained", "random"
PLAYERS = {UNTRAINED: "before training", RANDOM: "random latents", TRAINED: "after training"}
"""By name, in words."""

Player = Callable[[Obs], Tensor]
"""From observations to actions `[N, A]` of one decision."""


def make_players(config: TaskTrainConfig, world: World, folder: Path) -> dict[str, Player]:
    """All that there are for a run; random latents only where a policy follows them.

    Raises:
        AgentError: the checkpoint in `folder` is damaged or does not fit.
    """
    players = {UNTRAINED: _mean_of(make_policy(config, world)[0])}
    if world.decisions is not world.env:
        players[RANDOM] = _random(config, world)
    players[TRAINED] = _mean_of(load_policy(config, world, folder))
    return players


def _mean_of(policy: TaskAgent) -> Player:
    return lambda obs: policy.act(obs, deterministic=True).action


def _random(config: TaskTrainConfig, world: World) -> Player:
    """Latents that are uniform on the sphere, and labels that are all alike, a new one for every decision."""
    generator = torch.Generator().manual_seed(config.seed)
    shape = world.decisions.action_space.shape
    assert shape is not None
    # a normal vector has a uniform direction, and of normal scores each is the highest as often
    return lambda obs: torch.randn(shape, generator=generator)
