"""What keeps a character over its feet: virtual model control (Pratt et al. 2001) by the legs that stand."""

from typing import NamedTuple

import mujoco
import numpy as np
import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.physics import State
from murmillo.envs.rotations import heading_quat, quat_conj, quat_mul, quat_rotate, quat_rotate_inverse, quat_to_rotvec

_BORNE = 0.8
"""Share of the weight that the legs are told to bear; the rest their stiffness does."""
_STIFFNESS = (20.0, 20.0, 50.0)
"""[1/s^2] of what pulls the centre of mass to where the clip has it, heading frame, for each kilogram."""
_DAMPING = (6.0, 6.0, 8.0)
"""[1/s]"""
_TURN, _TURN_DAMPING = 1000.0, 60.0
"""[N m / rad], [N m s / rad] of what turns the root to the clip's orientation."""
_GRIP = 0.6
"""Of the weight: the greatest push forwards or sideways."""
_PUSH = 2.5
"""Of the weight: the greatest push upwards."""
_LIFTED = 0.03
"""[m] A foot of the clip that is higher does not stand."""
_TOUCH = 0.03
"""Of the weight: a foot stands on the ground that feels more."""


class _Joint(NamedTuple):
    body: int
    actions: slice
    axes: Tensor
    """[n, 3] in the body's frame."""


class _Leg(NamedTuple):
    joints: tuple[_Joint, ...]
    ankle: slice | None
    """Its actions; None where it is locked."""
    sole: Tensor
    """[2, 3] [m] Least and greatest torque of the ankle about x, y and z, for each newton that the foot bears."""


class _Posture(NamedTuple):
    """A whole body in world axes, [N, ...]."""

    feet: Tensor
    """[N, 2, 3] [m]"""
    centre: Tensor
    """[N, 3] [m] centre of mass."""
    velocity: Tensor
    """[N, 3] [m/s] its velocity."""
    root: Tensor
    """[N, 4]"""
    spin: Tensor
    """[N, 3] [rad/s] of the root."""


class Balance:
    """Changes targets of the joints so that the legs that stand push the body to where a clip has it.

    A spring and a damper would pull the centre of mass to its place over the standing feet, bear the weight and turn
    the root: a force F there and a moment M. The legs make them, each its share, by the torques -a . ((c - p) x F + M)
    of their joints at p about a: their Jacobians from the foot, transposed. An ankle's whole torque is no more than
    keeps the centre of pressure inside the sole, or the foot tips; of all parts that does the most (docs/learning.md).
    """

    def __init__(self, character: Character) -> None:
        """Raises SuiteError for a character that does not have two feet."""
        if len(character.feet) != 2:
            raise SuiteError(f"character={character.name}: has {len(character.feet)} feet; balance is for two")
        model, bodies = character.model, slice(1, 1 + len(character.bodies))
        self._character = character
        self._mass = torch.tensor(model.body_mass[bodies], dtype=torch.float32).unsqueeze(-1)
        self._inside = torch.tensor(model.body_ipos[bodies], dtype=torch.float32)
        self._total = self._mass.sum().item()
        self._weight = -model.opt.gravity[2] * self._total
        self._gain = torch.tensor(model.actuator_gainprm[:, 0], dtype=torch.float32)
        self._damping = torch.tensor(-model.actuator_biasprm[:, 2], dtype=torch.float32)
        self._feet = character.body_ids(character.feet)
        self._legs = [_leg(character, foot) for foot in self._feet]
        standing = character.forward_kinematics(character.default_qpos.to(self._mass))[0]
        self._height = standing[self._feet, 2]
        """[2] [m] of the feet's frames, standing."""

    def __call__(
        self, targets: Tensor, state: State, qpos: Tensor, qvel: Tensor, ground: Tensor | None = None
    ) -> Tensor:
        """Targets [N, A] [rad] that keep balance too, from targets [N, A] that do not.

        Args:
            state: of the worlds.
            qpos, qvel: [N, nq], [N, nv] of their clips at the same moment, over level ground at 0.
            ground: [N] [m] height of the worlds' ground; None is 0.
        """
        character = self._character
        clip = self._posture(*character.forward_kinematics(qpos), qvel)
        pos, quat, now = state.body_pos_w.float(), state.body_quat_w.float(), state.qvel.float()
        here = self._posture(pos, quat, now)
        share = self._shares(clip)
        pressed = state.ground_force_w[:, self._feet, 2].float()
        stands = (share > 0.0) & (pressed > _TOUCH * self._weight)
        force, moment = self._wrench(clip, here, share, 0.0 if ground is None else ground.float())
        share = share * stands
        pressed = torch.maximum(pressed, 0.5 * self._weight * share)
        coordinates, targets = character.joint_coordinates(state.qpos).float(), targets.clone()
        for number, leg in enumerate(self._legs):
            for joint in leg.joints:
                arm = here.centre - pos[:, joint.body]
                torque_w = -share[:, number, None] * (torch.linalg.cross(arm, force) + moment)
                torque = quat_rotate_inverse(quat[:, joint.body], torque_w) @ joint.axes.T
                targets[:, joint.actions] += torque / self._gain[joint.actions]
            if (ankle := leg.ankle) is not None:
                gain, damped = self._gain[ankle], self._damping[ankle] * now[:, 6:][:, ankle]
                torque = gain * (targets[:, ankle] - coordinates[:, ankle]) - damped
                least, most = leg.sole.unsqueeze(1) * pressed[:, number, None]
                kept = coordinates[:, ankle] + (torch.minimum(torch.maximum(torque, least), most) + damped) / gain
                targets[:, ankle] = torch.where(stands[:, number, None], kept, targets[:, ankle])
        return targets

    def _posture(self, pos_w: Tensor, quat_w: Tensor, qvel: Tensor) -> _Posture:
        """Of body frames [N, B, 3], [N, B, 4] at qvel [N, nv]."""
        velocity, spin = self._character.velocities(pos_w, quat_w, qvel)
        to_centre = quat_rotate(quat_w, self._inside)
        share = self._mass / self._total
        centre = ((pos_w + to_centre) * share).sum(-2)
        moved = ((velocity + torch.linalg.cross(spin, to_centre)) * share).sum(-2)
        return _Posture(pos_w[:, self._feet], centre, moved, quat_w[:, 0], spin[:, 0])

    def _shares(self, clip: _Posture) -> Tensor:
        """What of the weight each foot bears [N, 2]: the nearer the centre of mass the more, all where it is alone."""
        first, second = clip.feet[..., :2].unbind(1)
        line = second - first
        along = ((clip.centre[:, :2] - first) * line).sum(-1) / line.square().sum(-1).clamp_min(1e-4)
        along = along.clamp(0.05, 0.95)
        share = torch.stack((1.0 - along, along), -1) * (clip.feet[..., 2] - self._height < _LIFTED)
        return share / share.sum(-1, keepdim=True).clamp_min(1e-6)

    def _wrench(self, clip: _Posture, here: _Posture, share: Tensor, ground: Tensor | float) -> tuple[Tensor, Tensor]:
        """Force at the centre of mass [N, 3] [N] and moment [N, 3] [N m] that lead to the clip, world axes."""
        heading, of_clip = heading_quat(here.root), heading_quat(clip.root)
        turn = quat_mul(heading, quat_conj(of_clip))
        over_feet = [seen.centre - (seen.feet * share.unsqueeze(-1)).sum(1) for seen in (clip, here)]
        off = quat_rotate(turn, over_feet[0]) - over_feet[1]
        off[:, 2] = clip.centre[:, 2] - here.centre[:, 2] + ground
        slow = quat_rotate(turn, clip.velocity) - here.velocity
        force = self._total * (off.new_tensor(_STIFFNESS) * off + off.new_tensor(_DAMPING) * slow)
        level = force[:, :2]
        force[:, :2] = level * (_GRIP * self._weight / level.norm(dim=-1, keepdim=True).clamp_min(1e-6)).clamp(max=1.0)
        force[:, 2] = (force[:, 2] + _BORNE * self._weight).clamp(0.0, _PUSH * self._weight)
        tilt = quat_to_rotvec(quat_mul(quat_mul(turn, clip.root), quat_conj(here.root)))
        return force, _TURN * tilt + _TURN_DAMPING * (quat_rotate(turn, clip.spin) - here.spin)


def _leg(character: Character, foot: int) -> _Leg:
    """The joints from this foot up to the root."""
    model, joints, body = character.model, [], foot + 1
    of_body = {int(model.joint(joint.name).bodyid[0]): joint for joint in character.joints}
    while body > 1:
        if (joint := of_body.get(body)) is not None:
            axes = torch.eye(3) if joint.kind == "ball" else torch.tensor(model.joint(joint.name).axis)[None].float()
            joints.append(_Joint(body - 1, joint.action, axes))
        body = int(model.body_parentid[body])
    ankle = of_body.get(foot + 1)
    return _Leg(tuple(joints), None if ankle is None else ankle.action, _sole(model, foot + 1))


def _sole(model: mujoco.MjModel, body: int) -> Tensor:
    """[2, 3] `_Leg.sole` of a foot whose geoms lie along its axes."""
    geoms = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == body]
    corners = [model.geom_pos[geom] + sign * model.geom_aabb[geom, 3:] for geom in geoms for sign in (-1.0, 1.0)]
    low, high = torch.tensor(np.array(corners)).float().aminmax(dim=0)
    # pressed at x ahead of the ankle and y beside it, the foot is held by a torque of -y about x and x about y
    return torch.stack((torch.stack((-high[1], low[0], -high[1])), torch.stack((-low[1], high[0], high[1]))))
