"""The frames of all clips at fixed moments, made once: windows that learners draw are gathered from them."""

import torch
from torch import Tensor

from murmillo.envs.character import CONTROL_DT
from murmillo.envs.motion.library import MotionLibrary

PHASES = 8
"""Moments in a control step."""
MOST_BYTES = 2**28
"""256 MiB, in which 38 minutes of clips find room with frames of 120 numbers; 115 kB a second of them."""

_MOMENT = CONTROL_DT / PHASES
_AT_ONCE = 8192
"""Frames that are made at a time, lest what is made on the way is larger than they are."""


class FrameGrid:
    """The frames of a library's clips at moments an eighth of a control step apart.

    Each moment stands for the eighth that it is in the middle of: a pose is at most 2.1 ms away from the one that was
    asked for, and moments drawn uniformly stay uniform.
    """

    def __init__(self, library: MotionLibrary) -> None:
        self._features = library.features
        self._moments = _moments(library)
        rows = self._moments + 1  # and in front of the moments of each clip its first frame
        self._first = rows.cumsum(0) - rows
        clip = torch.repeat_interleave(rows)
        row = torch.arange(len(clip), device=clip.device)
        time = ((row - self._first[clip]).double() - 0.5).clamp_min(0.0) * _MOMENT
        self._frames = torch.empty(len(clip), self._features.frame_dim, device=clip.device)
        for some in row.split(_AT_ONCE):
            self._frames[some] = self._features.recorded(*library.pose(clip[some], time[some]))

    @classmethod
    def of(cls, library: MotionLibrary) -> "FrameGrid | None":
        """The grid of a library; None where it would take more than `MOST_BYTES`."""
        rows = int((_moments(library) + 1).sum())
        return cls(library) if 4 * rows * library.features.frame_dim <= MOST_BYTES else None

    def window(self, clip: Tensor, time: Tensor, frames: int) -> Tensor:
        """`MotionLibrary.window` at the moments that stand for these times.

        Args:
            clip: [n] int64.
            time: [n] [s], within the clip's duration.
            frames: in a window, one control step apart.

        Returns:
            [n, frames, D] float32, oldest first. Before the clip begins its first frame is repeated.
        """
        newest = torch.minimum((time / _MOMENT).long(), self._moments[clip] - 1) + 1
        back = PHASES * torch.arange(frames - 1, -1, -1, device=clip.device)
        row = self._first[clip].unsqueeze(-1) + (newest.unsqueeze(-1) - back).clamp_min(0)
        seen = self._frames.index_select(0, row.flatten()).unflatten(0, row.shape)
        return self._features.window(seen)


def _moments(library: MotionLibrary) -> Tensor:
    """[C] how many moments each clip has; the last may stand for less than an eighth."""
    return (library.duration / _MOMENT - 1e-6).ceil().long().clamp_min(1)
