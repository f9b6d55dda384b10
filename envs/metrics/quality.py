"""Plain signs of how physical and how smooth a motion is. All are low for good motion, and to be read beside those of
the replayed clips, whose feet slide and whose bodies shake a little too."""

from collections.abc import Sequence

import torch
from torch import Tensor

from murmillo.envs.character import CONTROL_DT


def foot_slide(foot_pos_w: Tensor, touching: Tensor) -> float:
    """Mean speed over the ground of a foot that stands [m/s].

    A foot stands in a control step if it touches the ground at both ends of it.

    Args:
        foot_pos_w: [..., T + 1, N, 3] [m].
        touching: [..., T + 1, N] bool.

    Returns:
        NaN if no foot ever stands.
    """
    standing = touching[..., 1:, :] & touching[..., :-1, :]
    speed = foot_pos_w[..., :2].double().diff(dim=-3).norm(dim=-1) / CONTROL_DT
    return speed[standing].mean().item()


def jerk(pos_w: Tensor) -> float:
    """Mean size of the third difference of positions over time [m/s^3].

        |x_{t+3} - 3 x_{t+2} + 3 x_{t+1} - x_t| / dt^3

    Args:
        pos_w: [..., T, P, 3] of P points, T >= 4, in double precision if there is any: the difference is small [m].
    """
    return (pos_w.double().diff(n=3, dim=-3).norm(dim=-1) / CONTROL_DT**3).mean().item()


def power(torque: Tensor, velocity: Tensor) -> float:
    """Mean energy that the actuators turn over [J/s]: sum_a |tau_a omega_a|, braking counted as driving.

    Args:
        torque: [..., A] [N m].
        velocity: [..., A] of the actuators [rad/s].
    """
    return (torque * velocity).abs().sum(-1, dtype=torch.float64).mean().item()


def residual_share(force: Tensor, torque: Tensor, joints: Sequence[slice]) -> float:
    """How large the residual forces are beside what the character does itself (C·ASE, section 4.2).

        sum_j ||xi_j|| / sum_j ||tau_j||, both summed over all steps

    Low is good. The paper reports 0.842 % over 1,024 trajectories of 200 steps. It compares the size of the residual
    forces to "the internal force derived from PD target control": newtons to newton metres, and so does this.

    Args:
        force: [..., J, 3] residual force at each joint [N].
        torque: [..., A] of the actuators, in the order of actions [N m].
        joints: the actions of each joint; a joint's torque is the norm of its own.
    """
    internal = torch.stack([torque[..., joint].double().norm(dim=-1).sum() for joint in joints]).sum()
    return (force.double().norm(dim=-1).sum() / internal).item()
