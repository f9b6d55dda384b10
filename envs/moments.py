"""Where in the clips episodes begin: by the clips' weights, or more often where late episodes fell."""

import torch
from torch import Tensor

from murmillo.envs.motion import MotionLibrary

STRETCH = 0.5
"""[s] The clips are cut into stretches of this length, whose falls are counted together."""

_MEMORY = 0.05
"""Of an episode, in the share of falls of the stretch that it began in."""


class StartingMoments:
    """Draws moments of the clips, a share of them by how often the episodes that began near there fell.

    It is the adaptive sampling of BeyondMimic (Liao et al. 2025, section III-F) with starts in place of ends: what
    befalls an episode is counted where it began. As long as all fall all moments are drawn alike.

    Attributes:
        falls: [M] float64 share of the late episodes begun in each stretch that ended in a fall; 1 before there are
            any.
    """

    def __init__(self, library: MotionLibrary, adaptive: float) -> None:
        """`adaptive` is the share that is drawn by the falls."""
        self._library, self._adaptive = library, adaptive
        count = (library.duration / STRETCH).ceil().long().clamp_min(1)
        self._first = count.cumsum(0) - count
        self._clip = torch.arange(len(count), device=library.device).repeat_interleave(count)
        self._weight = (library.weight / library.duration.clamp_min(1e-9))[self._clip] * self._length()
        self.falls = torch.ones(len(self._clip), dtype=torch.float64, device=library.device)

    def draw(self, n: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Clips [n] int64 and times [n] float64 [s]."""
        clip, time = self._library.sample(n, generator)
        if not self._adaptive:
            return clip, time
        chance = self._weight * (self.falls + 1e-3)
        stretch = torch.multinomial(chance, n, replacement=True, generator=generator)
        part = torch.rand(n, dtype=torch.float64, generator=generator)
        chosen = torch.rand(n, generator=generator) < self._adaptive
        there = self._clip[stretch]
        begun = (stretch - self._first[there]) * STRETCH
        return torch.where(chosen, there, clip), torch.where(chosen, begun + part * self._length()[stretch], time)

    def stretch(self, clip: Tensor, time: Tensor) -> Tensor:
        """[n] int64, the stretches of moments [n]."""
        last = torch.cat((self._first[1:], self._first.new_tensor([len(self._clip)])))[clip] - 1
        return torch.minimum(self._first[clip] + (time / STRETCH).long(), last)

    def note(self, stretch: Tensor, fell: Tensor) -> None:
        """Episodes that began in stretches [n] have ended, by a fall where fell [n] bool."""
        number = torch.zeros_like(self.falls).index_add(0, stretch, torch.ones_like(stretch, dtype=torch.float64))
        fallen = torch.zeros_like(self.falls).index_add(0, stretch, fell.double())
        late = fallen / number.clamp_min(1.0)
        self.falls = self.falls + (1.0 - (1.0 - _MEMORY) ** number) * (late - self.falls)

    def _length(self) -> Tensor:
        """[M] [s] of each stretch; the last of a clip is what is left of it."""
        begun = (torch.arange(len(self._clip), device=self._clip.device) - self._first[self._clip]) * STRETCH
        return (self._library.duration[self._clip] - begun).clamp(1e-9, STRETCH)
