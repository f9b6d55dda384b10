"""How well a task is done."""

import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError
from murmillo.envs.metrics.alignment import warping_path
from murmillo.envs.metrics.spread import Spread

_ROUNDING = 1e-6
"""By which a float32 reward may miss its bounds, as a share of their distance."""


def normalised_return(reward: Tensor, low: float, high: float) -> Spread:
    """Return of an episode between the least possible, 0, and the most possible, 1 (ASE, Table 1).

        (1/T) sum_t (r_t - low) / (high - low)

    Up is good. The paper's ± is over three models of 4,096 episodes each, this one over episodes.

    Args:
        reward: [n, T] of n episodes; one that ends early goes on with `low`.
        low: least reward of a step.
        high: greatest reward of a step.

    Raises:
        SuiteError: a reward outside these bounds, which then bound nothing.
    """
    slack = _ROUNDING * (high - low)
    if reward.min() < low - slack or reward.max() > high + slack:
        raise SuiteError(
            f"normalised return: rewards from {reward.min():.6g} to {reward.max():.6g} "
            f"do not lie in [{low:g}, {high:g}]; give the bounds of the task's reward"
        )
    return Spread.of((reward.double().mean(-1) - low) / (high - low))


def reach_error(hand_w: Tensor, target_w: Tensor) -> Spread:
    """Distance from what reaches to where it should be [m] (ASE, section 10.2: 0.088 ± 0.046); down is good.

    Args:
        hand_w: [..., 3] [m]; in ASE the tip of the sword.
        target_w: [..., 3] [m].
    """
    return Spread.of((hand_w.double() - target_w).norm(dim=-1))


def heading_cosine(velocity_w: Tensor, direction_w: Tensor) -> float:
    """Cosine between requested and actual direction of movement on the ground (CALM, section 8.2.1 and Table 2).

    Up is good: 1 straight there, -1 straight away, 0 for standing still. CALM reports 0.91 to 0.92.

    Args:
        velocity_w: [..., 2 or 3] of the root [m/s]; heights are left out.
        direction_w: [..., 2 or 3], of any length.
    """
    velocity, direction = velocity_w[..., :2].double(), direction_w[..., :2].double()
    return torch.cosine_similarity(velocity, direction, dim=-1).mean().item()


def imitation_error(pos: Tensor, reference: Tensor, align: bool = True) -> Spread:
    """Mean distance of the bodies from a reference motion's [m], over time (AdaptNet, eq. 15); down is good.

        e_t = 1/L sum_l ||p_l - p~_l||

    The paper takes world positions and names no alignment. Of the works whose measure it says it follows, AMP (Peng et
    al. 2021) takes positions relative to the root and synchronises by dynamic time warping. Positions are compared as
    they are given: relative to the root unless both motions are to be in one place. A warping has the mean over the
    pairs of its path, from first frames to last: every frame of the reference counts, so that nobody gains by waiting
    in a pose of it, and a clip that repeats is to be repeated as often as in the motion.

    Args:
        pos: [T, L, 3] of L bodies [m].
        reference: [F, L, 3] of the same bodies [m].
        align: warp time; without, F is T and frames are compared one by one.

    Raises:
        SuiteError: frames to compare one by one that are not as many.
    """
    if align:
        cost = _mean_distances(pos.double(), reference.double())
        return Spread.of(cost[warping_path(cost)])
    if len(pos) != len(reference):
        raise SuiteError(
            f"imitation error: {len(pos)} frames against {len(reference)}; cut them to one length or align"
        )
    return Spread.of((pos.double() - reference).norm(dim=-1).mean(-1))


def _mean_distances(pos: Tensor, reference: Tensor) -> Tensor:
    """[T, F] of eq. 15 for every frame of the one beside every frame of the other."""
    a, b = pos.transpose(0, 1), reference.transpose(0, 1)
    return torch.cdist(a, b, compute_mode="donot_use_mm_for_euclid_dist").mean(0)  # equal poses are to have exactly 0
