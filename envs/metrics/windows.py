"""Stretches of motion of one length: what is compared and classified."""

from collections.abc import Sequence

import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError


def windows(motion: Sequence[Tensor], frames: int, hop: int = 1) -> Tensor:
    """Every window of each motion, oldest frame first; none reaches over the end of a motion.

    Args:
        motion: [F_i, D] each, a frame a control step; those shorter than a window have none.
        frames: of a window, 1 for single states and 2 for transitions.
        hop: frames from one window's start to the next's.

    Returns:
        [n, frames, D].

    Raises:
        SuiteError: no motion is long enough.
    """
    found = [one.unfold(0, frames, hop).transpose(1, 2) for one in motion if len(one) >= frames]
    if not found:
        longest = max((len(one) for one in motion), default=0)
        raise SuiteError(f"windows of {frames} frames: the longest motion has {longest}; ask for shorter windows")
    return torch.cat(found)
