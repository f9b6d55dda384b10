"""The noise of actions, which is how a policy explores."""

from typing import Any

import torch
from torch import Tensor

from murmillo.agents.common.ranks import ALONE, Part, Ranks

QUIET_STEPS = 45
"""Control steps that a stretch without noise lasts on average; a clip that stands still is lost sooner."""


class ActionNoise:
    """Standard normal noise for the actions of every world, correlated from step to step.

    e_t = rho e_{t-1} + sqrt(1 - rho^2) x_t with x_t standard normal, so that every e_t is standard normal too and PPO's
    log probabilities are those of single actions (Eberhard et al. 2023, "Colored noise in PPO"; they colour it
    otherwise). Noise that is white shakes a character that follows its targets; noise that lasts moves it.

    Worlds may have none for a while. A policy is played without: where its mean comes to rest, noise would have carried
    it on, and what it never comes to it cannot learn to leave.

    Attributes:
        quiet: `[N]` bool, the worlds that had no noise at the last step; None where all always have.
    """

    def __init__(
        self, generator: torch.Generator, correlation: float = 0.0, ranks: Ranks = ALONE, *, quiet_share: float = 0.0
    ) -> None:
        """
        Args:
            generator: draws it.
            correlation: rho, between the noise of successive actions, from 0 (white, as published) to below 1.
            ranks: who draw together; all must then call `step` at a time.
            quiet_share: of the steps without noise, in stretches of `QUIET_STEPS` on average.
        """
        self.generator = generator
        self.correlation = correlation
        self.ranks = ranks
        self.quiet_share = quiet_share
        self.quiet: Tensor | None = None
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
        if self.quiet_share:
            self.quiet = self._turns(worlds)
            noise = noise.masked_fill(self.quiet.unsqueeze(-1), 0.0)
        return noise

    def _turns(self, worlds: Part) -> Tensor:
        """Who has no noise now; a stretch with and a stretch without last as the share says."""
        drawn = worlds.of(torch.rand(worlds.total, generator=self.generator))
        if self.quiet is None or len(self.quiet) != len(drawn):
            return drawn < self.quiet_share
        ends, begins = 1 / QUIET_STEPS, self.quiet_share / (1 - self.quiet_share) / QUIET_STEPS
        return torch.where(self.quiet, drawn >= ends, drawn < begins)

    def state_dict(self) -> dict[str, Any]:
        """Of the worlds of all ranks, which must all ask for it; empty where the next noise depends on none before."""
        kept = {"last": self._last, "quiet": self.quiet}
        return {name: self.worlds(len(value)).whole(value) for name, value in kept.items() if value is not None}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self._last, self.quiet = (
            None if (whole := state.get(name)) is None else self.worlds(len(whole) // self.ranks.size).of(whole).clone()
            for name in ("last", "quiet")
        )
