"""The latents that a user chooses by hand: new ones, favourites, the encodings of clips, and what lies between two."""

from typing import Protocol, runtime_checkable

import torch
from torch import Tensor

from murmillo.agents.common.latents import interpolate
from murmillo.envs import SuiteError
from murmillo.envs.motion import MotionLibrary
from murmillo.viewer.pilots import WORLD, SteerableAgent

FAVOURITES = 8


class MotionEncoder(Protocol):
    """What encodes motions of a number of frames."""

    frames: int


@runtime_checkable
class Encoding(Protocol):
    """An agent that follows clips by their encodings."""

    encoder: MotionEncoder

    def encode(self, window: Tensor, mask: Tensor | None = None) -> Tensor:
        """Latents `[B, Z]` of motions `[B, F, D]`; `mask` `[B, D]` bool is true for what a motion leaves out."""
        ...


class Latents:
    """Which latent the agent follows: one that the user chose, or its own as they come.

    Attributes:
        named: latents `[Z]` that can be chosen by name: favourites, and the clips' where the agent encodes them.
        chosen: the latent `[Z]` that the user holds; None while the agent draws its own.
        current: the latent `[Z]` of the last step.
    """

    def __init__(self, agent: SteerableAgent, library: MotionLibrary) -> None:
        self.named = _encoded_clips(agent, library) if isinstance(agent, Encoding) else {}
        self.chosen: Tensor | None = None
        self.current = torch.zeros(agent.latent_dim)
        self._agent = agent
        self._kept = 0

    def draw(self) -> None:
        """Follow a new latent, as drawn in training."""
        self._choose(self._agent.draw_latents(1)[0])

    def keep(self) -> str:
        """Make the latent of the last step a favourite and return its name; the ninth takes the place of the first."""
        name = f"favourite {self._kept % FAVOURITES + 1}"
        self._kept += 1
        self.named[name] = self.current.clone()
        return name

    def follow(self, first: str, second: str | None = None, part: float = 0.0) -> None:
        """Follow a named latent, or what lies at `part` in [0, 1] of the way from it to a second.

        Raises:
            SuiteError: there is none of that name.
        """
        start = self._of(first)
        self._choose(start if second is None else interpolate(start, self._of(second), part))

    def wander(self) -> None:
        """Let the agent draw its own again."""
        self.chosen = None
        self._agent.reset(WORLD)

    def renew(self) -> None:
        """Follow what was chosen in a new episode too."""
        if self.chosen is not None:
            self._agent.follow(self.chosen)

    def _choose(self, latent: Tensor) -> None:
        self.chosen = latent
        self._agent.follow(latent)

    def _of(self, name: str) -> Tensor:
        if name not in self.named:
            raise SuiteError(f"latent {name}: there is none of that name; there are: {', '.join(self.named) or 'none'}")
        return self.named[name]


def _encoded_clips(agent: Encoding, library: MotionLibrary) -> dict[str, Tensor]:
    """Of every clip, the encoding `[Z]` of its middle."""
    names = [clip.name for clip in library.clips]
    return dict(zip(names, agent.encode(library.middle(names, agent.encoder.frames), library.mask), strict=True))
