"""Random labels, as C·ASE tries them to see what labels are worth (A.2.2)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip


def at_random(clips: Sequence[Clip], groups: int, seed: int = 0) -> list[Clip]:
    """The clips dealt at random into `groups` labels, none of which has more than one clip more than another.

    Raises:
        MotionError: fewer than one group, or more than there are clips.
    """
    check_groups(groups, len(clips))
    order = np.random.default_rng(seed).permutation(len(clips))
    label = dict(zip(order.tolist(), (group_name("random", i % groups) for i in range(len(clips))), strict=True))
    return [replace(clip, label=label[i]) for i, clip in enumerate(clips)]


def check_groups(groups: int, clips: int) -> None:
    """Refuse a number of groups that these clips cannot be put into.

    Raises:
        MotionError: below 1 or above the number of clips.
    """
    if not 1 <= groups <= clips:
        raise MotionError(f"groups={groups}: needs a number from 1 to the {clips} clips")


def group_name(stem: str, index: int) -> str:
    """Name of a group that has none of its own: cluster_01 is the first."""
    return f"{stem}_{index + 1:02}"
