"""What the demonstrations leave out, for windows that have no clip of their own."""

import torch
from torch import Tensor

from murmillo.agents.common.interface import Demonstrations
from murmillo.agents.common.ranks import Part


class FeatureMasks:
    """Masks for the agent's windows, distributed like those of the demonstrations that they are compared with.

    A clip whose source knew no sword says nothing of where the sword is. Its window then has zeros there, and a
    discriminator would tell clips from the agent by these zeros alone, were they not in the agent's windows too (C·ASE,
    appendix A.5). They are drawn once, by a generator of their own: a resumed run has the same.
    """

    def __init__(self, demonstrations: Demonstrations, skills: int | None = None, draws: int | None = None) -> None:
        """
        Args:
            demonstrations: their "mask" `[n, D]`, if any, says what is left out.
            skills: K, where windows are compared with demonstrations of their own skill; None where with any.
            draws: demonstrations to learn the masks from, of each skill; 256, or 1,024 of all.
        """
        draws = draws or (1024 if skills is None else 256)
        skill = None if skills is None else torch.arange(skills).repeat_interleave(draws)
        # a mask is the same for all frames of a clip: windows of one are enough, and cheap
        mask = demonstrations((skills or 1) * draws, torch.Generator().manual_seed(0), skill, frames=1).get("mask")
        self._masks = None if mask is None or not mask.any() else mask.unflatten(0, (-1, draws))

    def draw(
        self, n: int, generator: torch.Generator, skill: Tensor | None = None, *, part: Part | None = None
    ) -> Tensor | None:
        """Masks `[n, D]` bool of demonstrations of the skills `[n]`; None, and no draw, if nothing is left out.

        `part` says which rows of a batch the n are; it is drawn for all.
        """
        if self._masks is None:
            return None
        draw = torch.randint(self._masks.shape[1], (n if part is None else part.total,), generator=generator)
        draw = draw if part is None else part.of(draw)
        return self._masks[0 if skill is None else skill, draw]
