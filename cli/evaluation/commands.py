"""What a policy is told: latents, and of labels or motions whatever its agent understands."""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from murmillo.envs.character import CONTROL_DT
from murmillo.envs.motion import MotionLibrary


@dataclass(frozen=True)
class Command:
    """What n worlds are told.

    Attributes:
        latent: [n, Z].
        skill: [n] int64, of an agent that is told labels.
        clip: [n] int64, of an agent whose latents are encodings of motions: the clip that was encoded.
    """

    latent: Tensor
    skill: Tensor | None = None
    clip: Tensor | None = None

    def where(self, kept: Tensor, other: "Command") -> "Command":
        """This command in the worlds of kept [n] bool, the other one elsewhere."""
        pairs = ((self.skill, other.skill), (self.clip, other.clip))
        skill, clip = (None if a is None or b is None else torch.where(kept, a, b) for a, b in pairs)
        return Command(torch.where(kept[:, None], self.latent, other.latent), skill, clip)


class Commander:
    """Draws commands from an agent's own generator, which the caller has seeded.

    The first commands of all trajectories together go through the skills, or through the clips that an encoder turns
    into latents, in turn: so few trajectories as there are skills have each of them once. Second ones are random.
    """

    def __init__(self, library: MotionLibrary, labelled: bool, encodes: bool) -> None:
        self.library, self.labelled, self.encodes = library, labelled, encodes

    def first(self, agent: Any, numbers: Tensor) -> Command:
        """Commands of the trajectories `numbers` [n] among all."""
        return self._command(agent, numbers % self._kinds)

    def random(self, agent: Any, n: int) -> Command:
        return self._command(agent, torch.randint(self._kinds, (n,), generator=agent.generator))

    @property
    def _kinds(self) -> int:
        return len(self.library.clips) if self.encodes else len(self.library.skills)

    def _command(self, agent: Any, kind: Tensor) -> Command:
        if self.encodes:
            return Command(self._encode(agent, kind), clip=kind)
        return Command(agent.draw_latents(len(kind)), skill=kind if self.labelled else None)

    @torch.no_grad()
    def _encode(self, agent: Any, clip: Tensor) -> Tensor:
        """Encodings [n, Z] of windows at random times of these clips, as in training."""
        frames = agent.encoder.frames
        duration = self.library.duration[clip]
        earliest = duration.clamp_max((frames - 1) * CONTROL_DT)
        part = torch.rand(len(clip), generator=agent.generator, dtype=torch.float64)
        mask = None if self.library.mask is None else self.library.mask[clip]
        return agent.encode(self.library.window(clip, earliest + part * (duration - earliest), frames), mask)
