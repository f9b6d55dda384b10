"""The character as its MJCF has it: names, layouts, action targets, kinematics. Nothing of it is written elsewhere."""

from collections.abc import Callable, Iterable
from functools import cached_property
from importlib.resources import files
from typing import Literal

import mujoco
import numpy as np
import torch
from torch import Tensor

from murmillo.envs.devices import Placed
from murmillo.envs.errors import SuiteError
from murmillo.envs.kinematics import BodyTree, Joint
from murmillo.envs.rotations import quat_from_rotvec, quat_to_rotvec

CONTROL_DT = 1.0 / 30.0
"""Seconds between two actions: the papers' 30 Hz."""

_KEY = "key_"  # sites of this prefix are the papers' key points
_KEY_ORDER = ("right_hand", "left_hand", "right_foot", "left_foot", "sword", "shield")
_GROUND = "ground_"  # contact sensors of this prefix hold the ground's force on a body
_VISUAL_GROUP = 2  # geoms that are seen but touch nothing
_BOX = 6  # bounds of a ball joint's exponential map

SpecEdit = Callable[[mujoco.MjSpec], None]


class Character:
    """A compiled MJCF character with a free root, ball and hinge joints, and position actuators on all of them.

    An action component a in [-1, 1] is mapped to the actuator's `ctrlrange`: target = offset + scale * a [rad]. A ball
    joint's three actuators hold its exponential map (ASE section 8.1), so a target is a rotation vector.

    Attributes:
        name: file name of the MJCF without its suffix.
        model: the model that is simulated; it has no visual geoms.
        control_dt, substeps: seconds of a control step, and physics steps in it.
        bodies: names of the B bodies without the world, in MJCF order.
        joints: the joints without the root, in MJCF order, which is also the order of the actions.
        key_bodies: names of the bodies whose origins are the K key points.
        feet: the bodies that may touch the ground.
        contact_slice: where the model's sensor data hold the ground's force on each body, [B * 3] [N].
        base: the character as it was before its body was changed, whose clips it follows; itself where it was not.
        pruned: the actions of `base` that it has no joint for.
        action_offset, action_scale: [A] [rad], float64.
        joint_limits: [A, 2] lowest and highest joint coordinate [rad], float64: of a hinge its range, of a ball joint
            the box of its exponential map (the MJCF's `user`), which the engine does not enforce.
    """

    def __init__(self, name: str, spec: mujoco.MjSpec, base: "Character | None" = None) -> None:
        self.name = name
        self.control_dt = CONTROL_DT
        self._spec = spec
        self.model = without_visuals(spec).compile()
        model = self.model
        self.substeps = round(CONTROL_DT / model.opt.timestep)
        if not np.isclose(self.substeps * model.opt.timestep, CONTROL_DT):
            raise SuiteError(f"{name}.xml: timestep {model.opt.timestep:g} s does not divide a control step of 1/30 s")
        _refuse_offsets(name, model)
        self.bodies = tuple(model.body(i).name for i in range(1, model.nbody))
        self.joints = tuple(_joints(name, model))
        self._tree = BodyTree(model, self.joints)
        keys = [model.site(i).name for i in range(model.nsite) if model.site(i).name.startswith(_KEY)]
        self.key_bodies = tuple(
            sorted((key.removeprefix(_KEY) for key in keys), key=lambda body: _KEY_ORDER.index(body))
        )
        self.feet = tuple(body for body in self.bodies if body.endswith("_foot"))
        self.contact_slice = _contact_slice(name, model, self.bodies)
        low, high = torch.from_numpy(model.actuator_ctrlrange.copy()).unbind(-1)
        self.action_offset = 0.5 * (low + high)
        self.action_scale = 0.5 * (high - low)
        self._offset, self._scale = Placed(self.action_offset), Placed(self.action_scale)
        self.joint_limits = torch.from_numpy(np.vstack([joint_box(model, joint.name) for joint in self.joints]))
        self.base = base or self
        names = {joint.name for joint in self.joints}
        kept = [joint for joint in self.base.joints if joint.name in names]
        self.pruned = tuple(sorted(set(range(self.base.action_dim)) - set(_columns(joint.action for joint in kept))))
        self._kept_qpos = [*range(7), *_columns(joint.qpos for joint in kept)]
        self._kept_dof = [*range(6), *_columns(joint.dof for joint in kept)]

    @property
    def action_dim(self) -> int:
        """Number of actuated degrees of freedom A."""
        return self.model.nu

    @cached_property
    def lag(self) -> float:
        """[s] by which a joint follows a target that moves steadily: damping over stiffness, the joints' median."""
        return float(np.median(-self.model.actuator_biasprm[:, 2] / self.model.actuator_gainprm[:, 0]))

    def body_ids(self, names: tuple[str, ...]) -> list[int]:
        """Positions of these bodies in `bodies`."""
        return [self.bodies.index(name) for name in names]

    def targets(self, action: Tensor) -> Tensor:
        """Actions [..., A] to PD targets [..., A] [rad]; actions are clamped to [-1, 1]."""
        return self._offset.like(action) + self._scale.like(action) * action.clamp(-1.0, 1.0)

    def action_of(self, targets: Tensor) -> Tensor:
        """Actions [..., A] whose targets [rad] are these [..., A], clamped to [-1, 1]."""
        return ((targets - self._offset.like(targets)) / self._scale.like(targets)).clamp(-1.0, 1.0)

    def joint_coordinates(self, qpos: Tensor) -> Tensor:
        """What the actuators measure in the pose qpos [..., nq]: exponential maps and angles [..., A] [rad]."""
        parts = [
            quat_to_rotvec(qpos[..., joint.qpos]) if joint.kind == "ball" else qpos[..., joint.qpos]
            for joint in self.joints
        ]
        return torch.cat(parts, dim=-1)

    def action_for(self, qpos: Tensor) -> Tensor:
        """The action [..., A] whose PD target is the pose qpos [..., nq], clamped to [-1, 1]."""
        return self.action_of(self.joint_coordinates(qpos))

    def pose(self, coordinates: Tensor, root_pos_w: Tensor, root_quat_w: Tensor) -> Tensor:
        """Inverse of `joint_coordinates`: qpos [..., nq] of joints [..., A] [rad] and a root [..., 3] [m], [..., 4]."""
        parts = [root_pos_w, root_quat_w]
        for joint in self.joints:
            value = coordinates[..., joint.action]
            parts.append(quat_from_rotvec(value) if joint.kind == "ball" else value)
        return torch.cat(parts, dim=-1)

    @cached_property
    def default_qpos(self) -> Tensor:
        """The zero pose on its feet [nq], float64."""
        return torch.from_numpy(self.model.qpos0.copy())

    def forward_kinematics(self, qpos: Tensor) -> tuple[Tensor, Tensor]:
        """Body frames in the world of the pose qpos [..., nq]: positions [..., B, 3] [m], quaternions [..., B, 4]."""
        return self._tree(qpos)

    def velocities(self, body_pos_w: Tensor, body_quat_w: Tensor, qvel: Tensor) -> tuple[Tensor, Tensor]:
        """Velocities of body frames [..., B, 3], [..., B, 4] at qvel [..., nv]: linear and angular [..., B, 3].

        Those of the frames' origins [m/s] and of the bodies [rad/s], in world axes.
        """
        return self._tree.velocities(body_pos_w, body_quat_w, qvel)

    def from_base(self, qpos: Tensor, qvel: Tensor) -> tuple[Tensor, Tensor]:
        """Poses [..., nq] and velocities [..., nv] of `base` in this character's layout, without what is locked."""
        return (qpos[..., self._kept_qpos], qvel[..., self._kept_dof]) if self.pruned else (qpos, qvel)

    def to_base(self, qpos: Tensor, qvel: Tensor) -> tuple[Tensor, Tensor]:
        """This character's poses [..., nq] and velocities [..., nv] in the layout of `base`; locked joints rest."""
        if not self.pruned:
            return qpos, qvel
        full_qpos = self.base.default_qpos.to(qpos).repeat(*qpos.shape[:-1], 1)
        full_qvel = qvel.new_zeros(*qvel.shape[:-1], self.base.model.nv)
        full_qpos[..., self._kept_qpos], full_qvel[..., self._kept_dof] = qpos, qvel
        return full_qpos, full_qvel

    def key_positions(self, qpos: Tensor) -> Tensor:
        """Key points [..., K, 3] [m] of the pose qpos [..., nq]; they lie at their bodies' origins."""
        return self.forward_kinematics(qpos)[0][..., self.body_ids(self.key_bodies), :]

    def spec(self) -> mujoco.MjSpec:
        """A copy of the spec that the models are compiled from, visual geoms and all."""
        return self._spec.copy()

    def render_model(self, offscreen: tuple[int, int] | None = None) -> mujoco.MjModel:
        """The model with its visual geoms, for pictures; its qpos layout is that of `model`."""
        spec = self._spec.copy()
        if offscreen is not None:
            spec.visual.global_.offwidth, spec.visual.global_.offheight = offscreen
        return spec.compile()


def load_character(name: str = "sword_shield", edit: SpecEdit | None = None) -> Character:
    """Load `assets/mjcf/<name>.xml`; `edit` may change the spec (body shapes, props, terrain) before it is compiled.

    Raises:
        SuiteError: there is no such character.
    """
    folder = files("murmillo.assets.mjcf")
    known = sorted(entry.name.removesuffix(".xml") for entry in folder.iterdir() if entry.name.endswith(".xml"))
    if name not in known:
        raise SuiteError(f"character={name}: no such character; there are: {', '.join(known)}")
    spec = mujoco.MjSpec.from_string((folder / f"{name}.xml").read_text(encoding="utf-8"))
    if edit is not None:
        edit(spec)
    return Character(name, spec)


def joint_box(model: mujoco.MjModel, name: str) -> np.ndarray:
    """Lowest and highest coordinates of a joint [1 or 3, 2] [rad]: a hinge's range, a ball's box about x, y and z.

    Raises:
        SuiteError: a ball joint whose MJCF has no box, six numbers in its `user`.
    """
    joint = model.joint(name)
    if joint.type[0] == mujoco.mjtJoint.mjJNT_HINGE:
        return joint.range.reshape(1, 2).copy()
    if joint.user.size != _BOX or not joint.user.any():
        raise SuiteError(f"joint {name}: has no box; give it six bounds [rad] in user and the size nuser_jnt={_BOX}")
    return joint.user.reshape(3, 2).copy()


def without_visuals(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Massless, untouchable geoms and all that serves the eye cost time in every step; training leaves them out."""
    bare = spec.copy()
    for geom in list(bare.geoms):
        if geom.group == _VISUAL_GROUP:
            bare.delete(geom)
    return bare


def _columns(slices: Iterable[slice]) -> list[int]:
    return [column for part in slices for column in range(part.start, part.stop)]


def _refuse_offsets(name: str, model: mujoco.MjModel) -> None:
    """Kinematics here is a chain of body offsets and joint rotations; frames that need more are refused."""
    if not np.allclose(model.body_quat, [1.0, 0.0, 0.0, 0.0]):
        raise SuiteError(f"{name}.xml: a body frame is rotated in its parent; rotate its geoms instead")
    if model.jnt_pos.any() or model.site_pos.any():
        raise SuiteError(f"{name}.xml: a joint or a key site lies off its body's origin; move the body instead")


def _joints(name: str, model: mujoco.MjModel) -> list[Joint]:
    """The joints after the root; refuses an MJCF whose actuators are not one a degree of freedom in joint order."""
    widths: dict[int, tuple[Literal["ball", "hinge"], int, int]] = {
        int(mujoco.mjtJoint.mjJNT_BALL): ("ball", 4, 3),
        int(mujoco.mjtJoint.mjJNT_HINGE): ("hinge", 1, 1),
    }
    joints, action = [], 0
    for i in range(1, model.njnt):
        joint = model.joint(i)
        if int(joint.type[0]) not in widths:
            raise SuiteError(f"{name}.xml: joint {joint.name} is neither a ball nor a hinge; make it one of them")
        kind, nq, nv = widths[int(joint.type[0])]
        if any(int(model.actuator_trnid[a, 0]) != i for a in range(action, action + nv)):
            raise SuiteError(f"{name}.xml: actuators must follow the joints' order; see joint {joint.name}")
        qpos, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        joints.append(Joint(joint.name, kind, slice(qpos, qpos + nq), slice(dof, dof + nv), slice(action, action + nv)))
        action += nv
    return joints


def _contact_slice(name: str, model: mujoco.MjModel, bodies: tuple[str, ...]) -> slice:
    """Where sensordata holds the ground's force on each body, [B * 3]."""
    sensors = [model.sensor(i) for i in range(model.nsensor) if model.sensor(i).name.startswith(_GROUND)]
    if tuple(sensor.name.removeprefix(_GROUND) for sensor in sensors) != bodies:
        raise SuiteError(f"{name}.xml: needs one contact sensor {_GROUND}<body> a body, in the bodies' order")
    start = int(sensors[0].adr[0])
    return slice(start, start + 3 * len(bodies))
