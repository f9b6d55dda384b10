"""What a character is asked to do while it is recorded, as the papers define it."""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class Protocol:
    """A trajectory in a fresh world that no fall and no clock ends.

    Attributes:
        name: of its chunks.
        title: for the report.
        steps: control steps of a trajectory.
        switch: least and most steps after which another command takes over, if one does.
        push: steps between which the root is pushed, if it is.
        most: no more trajectories than this are recorded, however many are asked for.
    """

    name: str
    title: str
    steps: int
    switch: tuple[int, int] | None = None
    push: tuple[int, int] | None = None
    most: int | None = None

    def trajectories(self, wanted: int) -> int:
        """How many are recorded where `wanted` are asked for."""
        return wanted if self.most is None else min(wanted, self.most)

    def draw_switch(self, n: int, generator: torch.Generator) -> Tensor:
        """[n] steps after which the second command takes over; all of them where none does."""
        least, most = self.switch or (self.steps, self.steps)
        return torch.randint(least, most + 1, (n,), generator=generator)

    def draw_cut(self, n: int, generator: torch.Generator) -> Tensor:
        """[n] first frames of the windows that are cut out."""
        return torch.randint(max(1, self.steps + 2 - WINDOW), (n,), generator=generator)


WINDOW = 30
"""Frames of the clip that is cut out of each trajectory at random (C·ASE's "per clip" distance has as many)."""

HELD = Protocol("held", "one command for 300 steps", 300)
SWITCHED = Protocol("switched", "one command for 200 steps, then another for 200 (C·ASE)", 400, switch=(200, 200))
SWITCHED_ASE = Protocol(
    "switched_ase", "one command for 150-200 of 300 steps, then another (ASE)", 300, switch=(150, 200)
)
PUSHED = Protocol(
    "pushed",
    "one command; after 1 s a push of 500-1,000 N on the root for 0.5 s, horizontally in any direction (ASE); "
    "10 s from its beginning are judged",
    330,
    push=(30, 45),
    most=500,
)
PUSH_N = (500.0, 1000.0)
"""Range of the push [N]."""
