"""Whether the character gets up again, and how soon."""

from dataclasses import dataclass

import torch
from torch import Tensor

from murmillo.envs.character import CONTROL_DT

ROOT_HEIGHT = 0.5
"""[m] A character whose root and head are above these has recovered."""
HEAD_HEIGHT = 1.0


@dataclass(frozen=True)
class Recovery:
    """What became of pushed characters; figures of no trials are NaN.

    Attributes:
        trials: pushes.
        fell: trials with a fall.
        standing: trials whose last step is upright: a recovery need not last.
        time_s: [recovered] from each fall to its recovery [s], in the order of the trials.
    """

    trials: int
    fell: int
    standing: int
    time_s: Tensor

    @property
    def share(self) -> float:
        """Recovered among the fallen; up is good."""
        return len(self.time_s) / self.fell if self.fell else float("nan")

    @property
    def mean_s(self) -> float:
        """Of the times of those that recovered [s]; down is good."""
        return self.time_s.mean().item()

    @property
    def max_s(self) -> float:
        """Of the times of those that recovered [s]; down is good."""
        return self.time_s.max().item() if len(self.time_s) else float("nan")


def recovery(root_height: Tensor, head_height: Tensor, fallen: Tensor) -> Recovery:
    """Falls and recoveries after a push (ASE, section 10.7 and figure 14).

    ASE pushes the root with 500 to 1,000 N from a random direction for 0.5 s, 500 times. A trial's fall is the first
    touch of the ground by anything but the feet; it has recovered once the root is above 0.5 m and the head above 1 m,
    which may be at that very step: a hand that breaks a stumble is a fall of 0 s. ASE reports that all recovered, in
    0.31 s on average and 4.1 s at most.

    Args:
        root_height: [n, T] from the push on, a column a control step [m].
        head_height: [n, T] of the head's body [m].
        fallen: [n, T] bool, something other than the feet touches the ground.
    """
    upright = (root_height > ROOT_HEIGHT) & (head_height > HEAD_HEIGHT)
    since_fall = fallen.cummax(1).values
    recovered = upright & since_fall
    fall, rise = (event.int().argmax(1) for event in (fallen, recovered))  # the first; 0 if there is none
    steps = (rise - fall)[recovered.any(1)]
    return Recovery(
        trials=len(fallen),
        fell=int(since_fall[:, -1].sum()),
        standing=int(upright[:, -1].sum()),
        time_s=steps.to(torch.float64) * CONTROL_DT,
    )
