"""How long episodes last and how they end."""

import math
from typing import Any

import torch
from torch import Tensor

from murmillo.agents.common.ranks import ALONE, Ranks


class EpisodeStatistics:
    """Counts every world's steps; sums up the episodes that ended since the last `summary`."""

    def __init__(self, num_envs: int) -> None:
        self.length = torch.zeros(num_envs, dtype=torch.int64)
        self._clear()

    def _clear(self) -> None:
        self._ended, self._fallen, self._steps = torch.zeros(3, dtype=torch.int64)

    def step(self, terminated: Tensor, done: Tensor) -> None:
        """One step of every world; bool `[N]`, `done` is terminated or truncated."""
        self.length += 1
        self._ended += done.sum()
        self._fallen += terminated.sum()
        self._steps += (self.length * done).sum()
        self.length[done] = 0

    def summary(self, ranks: Ranks = ALONE) -> dict[str, float]:
        """Mean length [steps] and share of terminations among the episodes that ended; NaN where none did."""
        counted = torch.stack([torch.as_tensor(count) for count in (self._ended, self._fallen, self._steps)])
        ended, fallen, steps = ranks.sum(counted).tolist()
        ended = ended or math.nan
        summary = {"episode/length": steps / ended, "episode/fall_rate": fallen / ended}
        self._clear()
        return summary

    def state_dict(self) -> dict[str, Any]:
        return {"length": self.length}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self.length.copy_(state["length"])
