"""Latent skills on the unit sphere: the one sampler, and the clocks that decide when a world gets a new one."""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional as F

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.ranks import ALONE, Part, Ranks


def sample_sphere(n: int, dim: int, generator: torch.Generator) -> Tensor:
    """`[n, dim]` uniform on the unit sphere: normalised Gaussians (ASE, eq. 11)."""
    return F.normalize(torch.randn(n, dim, generator=generator), dim=-1)


def interpolate(start: Tensor, end: Tensor, t: float | Tensor) -> Tensor:
    """Latents `[..., Z]` of unit length on the great circle from `start` to `end`, at t in [0, 1]."""
    angle = torch.acos((start * end).sum(-1, keepdim=True).clamp(-1 + 1e-6, 1 - 1e-6))
    return F.normalize(torch.sin((1 - t) * angle) * start + torch.sin(t * angle) * end, dim=-1)


class LatentSequence:
    """Every world's sequence of latents, each kept for a uniform 1 to 150 steps (ASE, section 6.4 and appendix A)."""

    def __init__(
        self,
        num_envs: int,
        dim: int,
        generator: torch.Generator,
        min_steps: int = 1,
        max_steps: int = 150,
        *,
        draw: Callable[[Tensor, Part], Tensor] | None = None,
        ranks: Ranks = ALONE,
    ) -> None:
        """
        Args:
            num_envs: N, of this rank.
            dim: Z.
            generator: draws latents and durations.
            min_steps, max_steps: range of the durations [control steps].
            draw: gives new latents `[n, Z]` for worlds `[n]`, which are a part of those of all ranks; uniform on the
                sphere without it.
            ranks: who draw together; all must then call `step` and `reset` at a time.
        """
        if not 1 <= min_steps <= max_steps:
            raise AgentError(f"latent_steps=[{min_steps}, {max_steps}] is no range of steps; the paper has [1, 150]")
        self.dim = dim
        self.min_steps = min_steps
        self.max_steps = max_steps
        self.generator = generator
        self.ranks = ranks
        self._draw = draw or (lambda env_ids, part: part.of(sample_sphere(part.total, dim, generator)))
        self.latent = torch.zeros(num_envs, dim)
        self.steps_left = torch.zeros(num_envs, dtype=torch.int64)
        self.reset(torch.arange(num_envs))

    def step(self) -> Tensor:
        """The latents of this step `[N, dim]`; a latent whose time is over is redrawn first."""
        self.reset((self.steps_left == 0).nonzero().flatten())
        self.steps_left -= 1
        return self.latent.clone()

    def reset(self, env_ids: Tensor) -> None:
        """New latents and durations for these worlds, `[n]` int64; n may be 0."""
        part = self.ranks.among(len(env_ids))
        if not part.total:
            return
        self.latent[env_ids] = self._draw(env_ids, part)
        steps = torch.randint(self.min_steps, self.max_steps + 1, (part.total,), generator=self.generator)
        self.steps_left[env_ids] = part.of(steps)

    def hold(self, latent: Tensor) -> None:
        """These latents `[N, Z]`, or `[Z]` for all worlds, until the next `reset`."""
        self.latent.copy_(latent.expand_as(self.latent))
        self.steps_left.fill_(torch.iinfo(torch.int64).max)

    def state_dict(self) -> dict[str, Any]:
        """Of the worlds of all ranks, which must all ask for it."""
        worlds = self.ranks.worlds(len(self.latent))
        return {"latent": worlds.whole(self.latent), "steps_left": worlds.whole(self.steps_left)}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        worlds = self.ranks.worlds(len(self.latent))
        if list(state["latent"].shape) != [worlds.total, self.dim]:
            raise AgentError(
                f"the checkpoint's latents [worlds, Z] are {list(state['latent'].shape)}, the run's "
                f"{[worlds.total, self.dim]}; go on with as many worlds as there were"
            )
        self.latent.copy_(worlds.of(state["latent"]))
        self.steps_left.copy_(worlds.of(state["steps_left"]))
