"""The motions that the worlds are told to follow, and their encodings."""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from murmillo.agents.common.discriminator import Windows
from murmillo.agents.common.latents import LatentSequence
from murmillo.agents.common.ranks import ALONE, Part, Ranks


class MotionSequence:
    """Every world's sequence of motions, each followed for some time; the latent of a world encodes its motion.

    After every update of the encoder `encode_again` renews the encodings, so that an action and its log probability
    belong to the encoder of the same iteration. (In the released code they may be older, which breaks PPO's ratios.)
    """

    def __init__(
        self,
        num_envs: int,
        latent_dim: int,
        steps: tuple[int, int],
        generator: torch.Generator,
        draw: Callable[[int], Windows],
        encode: Callable[[Windows], Tensor],
        ranks: Ranks = ALONE,
    ) -> None:
        """
        Args:
            num_envs: N.
            latent_dim: Z.
            steps: shortest and longest time that a motion is followed [control steps].
            generator: draws the durations.
            draw: gives n motions [n, F, D].
            encode: gives their latents [n, Z].
            ranks: who draw together; all must then call `step` and `reset` at a time.
        """
        self._draw, self._encode = draw, encode
        # all motions that were followed since `forget`, as they came; a rollout speaks of them by their rows
        self._followed: list[Windows] = []
        self._number = torch.zeros(num_envs, dtype=torch.int64)
        self._latents = LatentSequence(num_envs, latent_dim, generator, *steps, draw=self._begin, ranks=ranks)

    def step(self) -> tuple[Tensor, Tensor]:
        """The latents of this step [N, Z] and the number [N] of the motion that each encodes."""
        return self._latents.step(), self._number.clone()

    def reset(self, env_ids: Tensor) -> None:
        """Other motions for these worlds, [n] int64."""
        self._latents.reset(env_ids)

    def hold(self, latent: Tensor) -> None:
        """These latents [N, Z], or [Z] for all worlds, until the next `reset`; no motion stands behind them."""
        self._latents.hold(latent)

    def of(self, numbers: Tensor) -> Windows:
        """The motions [n, F, D] of these numbers [n], which `forget` and `encode_again` give out anew."""
        return select(self._all(), numbers)

    def mask(self, numbers: Tensor) -> Tensor | None:
        """What these motions [n] leave out, [n, D] bool; None where no motion leaves anything out."""
        masks = [motions.mask for motions in self._followed if motions.mask is not None]
        return torch.cat(masks)[numbers] if masks else None

    def forget(self) -> None:
        """Forget the motions that no world follows any more; the numbers given out so far are void."""
        if sum(len(motions.window) for motions in self._followed) > len(self._number):
            self._keep(self.of(self._number))

    @torch.no_grad()
    def encode_again(self) -> None:
        """Forget the motions that no world follows any more, and encode the others anew."""
        self.forget()
        self._latents.latent.copy_(self._encode(self.of(self._number)))

    @torch.no_grad()
    def _begin(self, env_ids: Tensor, part: Part) -> Tensor:
        drawn = self._draw(part.total)
        new = Windows(part.of(drawn.window), mask=part.of(drawn.mask))
        known = sum(len(motions.window) for motions in self._followed)
        self._number[env_ids] = known + torch.arange(len(env_ids))
        self._followed.append(new)
        return self._encode(new)

    def _all(self) -> Windows:
        """The motions behind all numbers, in one piece."""
        if len(self._followed) > 1:
            windows = torch.cat([motions.window for motions in self._followed])
            self._followed = [Windows(windows, mask=self.mask(torch.arange(len(windows))))]
        return self._followed[0]

    def _keep(self, followed: Windows) -> None:
        self._followed = [followed]
        self._number = torch.arange(len(self._number))

    def state_dict(self) -> dict[str, Any]:
        """Of the worlds of all ranks, which must all ask for it."""
        followed, worlds = self.of(self._number), self._latents.ranks.worlds(len(self._number))
        mask = {} if followed.mask is None else {"mask": worlds.whole(followed.mask)}
        return {"window": worlds.whole(followed.window), **mask, "latents": self._latents.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        worlds = self._latents.ranks.worlds(len(self._number))
        self._latents.load_state_dict(state["latents"])
        self._keep(Windows(worlds.of(state["window"]).clone(), mask=worlds.of(state.get("mask"))))


def select(motions: Windows, rows: Tensor) -> Windows:
    """These rows [n] of motions [M, F, D]."""
    return Windows(motions.window[rows], mask=None if motions.mask is None else motions.mask[rows])


def cut(motions: Windows, first: Tensor, frames: int) -> Windows:
    """Of each motion [n, F, D] the frames [n, frames, D] from the `first` [n] on."""
    rows = torch.arange(len(first))[:, None]
    return motions._replace(window=motions.window[rows, first[:, None] + torch.arange(frames)])
