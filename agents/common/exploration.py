"""The noise of actions, which is how a policy explores."""

from typing import Any

import torch
from torch import Tensor

from murmillo.agents.common.ranks import ALONE, Part, Ranks


class ActionNoise:
    """Standard normal noise for the actions of every world, correlated from step to step.

    e_t = rho e_{t-1} + sqrt(1 - rho^2) x_t with x_t standard normal, so that every e_t is standard normal too and PPO's
    log probabilities are those of single actions (Eberhard et al. 2023, "Colored noise in PPO"; they colour it
    otherwise). Noise that is white shakes a character that follows its targets; noise that lasts moves it.
    """

    def __init__(self, generator: torch.Generator, correlation: float = 0.0, ranks: Ranks = ALONE) -> None:
        """
        Args:
            generator: draws it.
            correlation: rho, between the noise of successive actions, from 0 (white, as published) to below 1.
            ranks: who draw together; all must then call `step` at a time.
        """
        self.generator = generator
        self.correlation = correlation
        self.ranks = ranks
        self._last: Tensor | None = None

    def worlds(self, n: int) -> Part:
        """This rank's n worlds among those that are drawn for."""
        return self.ranks.worlds(n)

    def step(self, num_envs: int, dim: int) -> Tensor:
        """Noise `[N, dim]` of the next action of each of this rank's N worlds."""
        worlds = self.worlds(num_envs)
        noise = worlds.of(torch.randn(worlds.total, dim, generator=self.generator))
        if self.correlation:
            if self._last is not None and len(self._last) == num_envs:  # it may have been loaded to play elsewhere
                noise = self.correlation * self._last + (1 - self.correlation**2) ** 0.5 * noise
            self._last = noise
        return noise

    def state_dict(self) -> dict[str, Any]:
        """Of the worlds of all ranks, which must all ask for it; empty where the next noise depends on none before."""
        return {} if self._last is None else {"last": self.worlds(len(self._last)).whole(self._last)}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        last = state.get("last")
        self._last = None if last is None else self.worlds(len(last) // self.ranks.size).of(last).clone()
