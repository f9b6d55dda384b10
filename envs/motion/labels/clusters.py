"""Labels for clips that have none: groups of similar motion."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from murmillo.envs.character import Character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.labels.chance import check_groups, group_name
from murmillo.envs.motion.labels.features import clip_features

RESTARTS = 10
VARIANCE = 0.95
"""Share of the features' variance that the principal components keep: distances in 240 dimensions are mostly noise."""


def cluster(clips: Sequence[Clip], character: Character, groups: int, seed: int = 0) -> list[Clip]:
    """The clips labelled by k-means of their motion: cluster_01 is the group of the first clip, and so on.

    k-means++ starts (Arthur and Vassilvitskii 2007), the best of ten, on the principal components of the features.

    Raises:
        MotionError: a number of groups that the clips cannot have, or scipy is not installed.
    """
    check_groups(groups, len(clips))
    try:
        from scipy.cluster.vq import ClusterError, kmeans2
    except ImportError:
        raise MotionError("clustering needs scipy; install it with: pip install murmillo[motion]") from None
    points = _principal(clip_features(clips, character).double().numpy())
    generator = np.random.default_rng(seed)
    best, members = np.inf, None
    for _ in range(RESTARTS):
        try:
            centres, found = kmeans2(points, groups, iter=100, minit="++", missing="raise", rng=generator)
        except ClusterError:  # this start lost a group
            continue
        loss = float(np.sum((points - centres[found]) ** 2))
        if loss < best:
            best, members = loss, found
    if members is None:
        raise MotionError(f"groups={groups}: the clips do not fall into so many groups; give a lower number")
    order = list(dict.fromkeys(members.tolist()))
    return [
        replace(clip, label=group_name("cluster", order.index(group)))
        for clip, group in zip(clips, members.tolist(), strict=True)
    ]


def _principal(features: np.ndarray) -> np.ndarray:
    """Features [C, D] of mean 0 in as many principal components [C, P] as hold `VARIANCE`."""
    left, scale, _ = np.linalg.svd(features, full_matrices=False)
    share = np.cumsum(scale**2) / max(float(np.sum(scale**2)), 1e-12)
    kept = int(np.searchsorted(share, VARIANCE)) + 1
    return (left * scale)[:, :kept]
