"""Worlds that know their number, and runs of the toy by one process or by several."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from murmillo.agents.ase.agent import ASE
from murmillo.agents.calm.agent import CALM
from murmillo.agents.case.agent import CASE
from murmillo.agents.common.ranks import ALONE, Ranks, joined
from murmillo.agents.common.runner import Runner, RunnerConfig
from tests.agents.toy import PointMass, small_ase, small_calm, small_case
from tests.agents.toy_adapted import base_of, make_parent

WORLDS, HORIZON = 12, 8


class Numbered(PointMass):
    """Every beginning is a function of the world's number in the whole run and of the episode's number in the world."""

    def __init__(self, num_envs: int, first: int = 0, **arguments: Any) -> None:
        super().__init__(num_envs, **arguments)
        self.number = first + np.arange(num_envs)
        self.episode = np.zeros(num_envs, np.int64)

    def _begin(self, worlds: np.ndarray) -> None:
        factors = np.array([[12.9898, 78.233, 37.719], [4.898, 7.23, 2.417]])
        drawn = np.stack([self.number[worlds] + 1, self.episode[worlds] + 1], 1) @ factors
        drawn = np.sin(drawn) * 43758.5453 % 1.0
        start = np.zeros((len(drawn), 4), np.float32)
        start[:, :2] = drawn[:, :2] - 0.5
        self.history[worlds] = start[:, None]
        self.clock[worlds] = 0
        below = (self.skill_weights / self.skill_weights.sum()).cumsum(0).numpy()
        self.skill[worlds] = np.searchsorted(below, drawn[:, 2]).clip(max=self.skills - 1)
        self.episode[worlds] += 1

    def state_dict(self) -> dict[str, Tensor]:
        return {**super().state_dict(), "episode": torch.from_numpy(self.episode.copy())}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        super().load_state_dict(state)
        self.episode = state["episode"].numpy().copy()


def make_run(folder: Path, ranks: Ranks, method: str, iterations: int, adapted: bool = False, **changes: Any) -> Runner:
    """A run of `WORLDS` worlds in all; `adapted` begins with a base."""
    generator = torch.Generator().manual_seed(3)
    share = WORLDS // ranks.size
    env = Numbered(share, first=share * ranks.rank, skills=3 if method == "case" else 1, episode_steps=6)
    kind, config = {"ase": (ASE, small_ase), "case": (CASE, small_case), "calm": (CALM, small_calm)}[method]
    settings = config(**changes)
    settings.ppo.minibatch = 40  # 96 samples: 40, 40 and 16
    settings.discriminator.replay_size = 150  # it is full in the second iteration
    settings.discriminator.replay_keep = 0.3
    base = base_of(make_parent(method, env.skills, **changes)) if adapted else None
    agent = kind(env, env.demonstrations, settings, generator, base, ranks=ranks)  # type: ignore[arg-type]
    limits = RunnerConfig(samples=iterations * WORLDS * HORIZON, horizon=HORIZON, gamma=0.9, lam=0.9)
    if method == "calm":
        limits.reward_weights = {"style": 1.0}
    return Runner(env, agent, limits, generator, folder, ranks=ranks)


def run_as(rank: int, size: int, port: int, folder: Path, runs: Mapping[str, tuple[str, dict[str, Any]]]) -> None:
    """Be one of `size` processes that train these runs, a method and its settings each, one after the other."""
    torch.set_num_threads(1)
    os.environ |= {"RANK": str(rank), "WORLD_SIZE": str(size), "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port)}
    with joined() as ranks:
        for name, (method, changes) in runs.items():
            train(folder / name, ranks, method, changes)


def train(folder: Path, ranks: Ranks, method: str, changes: dict[str, Any]) -> None:
    """Three iterations at once into `folder`/whole, and two and one more into `folder`/halves."""
    stats: list[dict[str, float]] = []
    runner = make_run(folder / "whole", ranks, method, 3, **changes)
    runner.on_iteration = [stats.append]
    runner.run()
    if ranks.first:
        torch.save(stats, folder / "stats.pt")
    make_run(folder / "halves", ranks, method, 2, **changes).run()
    rest = make_run(folder / "halves", ranks, method, 3, **changes)
    rest.generator.manual_seed(99)
    rest.load(folder / "halves")
    rest.run()


def train_alone(folder: Path, method: str, changes: dict[str, Any]) -> None:
    train(folder, ALONE, method, changes)
