"""Other bodies for a character: longer, thicker or denser links, and joints that are locked (AdaptNet, section 8.2).

A changed character keeps its bodies; its clips stay those of the character that it was (`Character.base`), as in the
paper, whose references are not retargeted.
"""

import math
from dataclasses import dataclass, field
from difflib import get_close_matches

import mujoco
import numpy as np

from murmillo.envs.character import Character, SpecEdit, load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.geometry import lowest_point

_TOUCH = 1e-3
"""[m] Limbs that reach deeper into one another interpenetrate."""


@dataclass
class BodyConfig:
    """How a character's body differs from its MJCF. Factors are by body; all that is not named stays.

    Attributes:
        shape: one of `SHAPES`, the paper's eight bodies; empty for none. The factors below are on top of its own.
        length: factors along a body: its geoms, and where the bodies that it carries begin.
        thickness: the same across it.
        density: factors of the density; a link's mass follows its volume too.
        locked: joints that are fixed in the zero pose, or names of `LOCKS`.
    """

    shape: str = ""
    length: dict[str, float] = field(default_factory=dict)
    thickness: dict[str, float] = field(default_factory=dict)
    density: dict[str, float] = field(default_factory=dict)
    locked: tuple[str, ...] = ()


def _both(part: str, factor: float) -> dict[str, float]:
    return {f"right_{part}": factor, f"left_{part}": factor}


SHAPES: dict[str, BodyConfig] = {
    "LongBody": BodyConfig(length={"pelvis": 1.5}),  # the abdomen lies between the pelvis and the torso's joint
    "BigBody": BodyConfig(length={"torso": 1.5}, thickness={"torso": 1.5}),
    "LongUpperArms": BodyConfig(length=_both("upper_arm", 1.25)),
    "LongLowerArms": BodyConfig(length=_both("lower_arm", 1.25)),
    "AsymmetricUpperArms": BodyConfig(length={"right_upper_arm": 1.25, "left_upper_arm": 0.75}),
    "LongThighs": BodyConfig(length=_both("thigh", 1.5)),
    "LongShins": BodyConfig(length=_both("shin", 1.5)),
    "SuperLongLegs": BodyConfig(length=_both("thigh", 1.5) | _both("shin", 1.5)),
}
"""The paper's bodies. It gives no factors for asymmetric arms and the longest legs; theirs are those of the others."""

LOCKS: dict[str, tuple[str, ...]] = {
    "abdomen": ("abdomen",),
    "elbows": ("right_elbow", "left_elbow"),
    "ankles": ("right_ankle", "left_ankle"),
    "right_knee": ("right_knee",),
}
"""The paper's four locks."""


def load_body(name: str, body: BodyConfig, edit: SpecEdit | None = None) -> Character:
    """The character of this name with another body, on its feet; `edit` as in `load_character`.

    Raises:
        SuiteError: a shape, a body or a joint that there is not, a factor that cannot be, or limbs that interpenetrate.
    """
    base = load_character(name, edit)
    if body == BodyConfig():
        return base
    length, thickness, density = (_factors(body, kind, base) for kind in ("length", "thickness", "density"))
    locked = _locked(body, base)
    spec = base.spec()
    for link in base.bodies:
        _scale(spec, link, _axis(base.model, link), length.get(link, 1.0), thickness.get(link, 1.0))
        for geom in spec.body(link).geoms:
            geom.density *= density.get(link, 1.0)
    for joint in locked:
        spec.delete(spec.joint(joint))  # and with it its actuators
    floating = Character(name, spec, base)
    spec.body(base.bodies[0]).pos[2] -= lowest_point(floating, floating.default_qpos).item()
    changed = Character(name, spec, base)
    _refuse_interpenetration(changed)
    return changed


def _factors(body: BodyConfig, kind: str, base: Character) -> dict[str, float]:
    """The factors of this kind by link, those of the shape and the config's own together."""
    if body.shape and body.shape not in SHAPES:
        near = get_close_matches(body.shape, SHAPES, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]}?" if near else f"there are: {', '.join(SHAPES)}"
        raise SuiteError(f"body.shape={body.shape}: no such shape; {hint}")
    factors = dict(getattr(SHAPES[body.shape], kind)) if body.shape else {}
    for link, factor in getattr(body, kind).items():
        if link not in base.bodies:
            raise SuiteError(f"body.{kind}.{link}: no such body; there are: {', '.join(base.bodies)}")
        if not (isinstance(factor, (int, float)) and math.isfinite(factor) and factor > 0.0):
            raise SuiteError(f"body.{kind}.{link}={factor}: needs a factor above 0")
        factors[link] = factors.get(link, 1.0) * factor
    return factors


def _locked(body: BodyConfig, base: Character) -> tuple[str, ...]:
    """The joints to lock."""
    joints = [joint.name for joint in base.joints]
    for name in body.locked:
        if name not in LOCKS and name not in joints:
            known = ", ".join(dict.fromkeys((*LOCKS, *joints)))
            raise SuiteError(f"body.locked={name}: no such joint; there are: {known}")
    locked = {joint for name in body.locked for joint in LOCKS.get(name, (name,))}
    if locked == set(joints):
        raise SuiteError("body.locked: all joints are locked; leave one to move")
    return tuple(joint for joint in joints if joint in locked)


def _axis(model: mujoco.MjModel, link: str) -> int:
    """Along which axis of its frame (0, 1, 2) a body lies, by where its geoms and the bodies that it carries are."""
    body = model.body(link).id
    places = [*model.geom_pos[model.geom_bodyid == body], *model.body_pos[model.body_parentid == body]]
    middle = np.abs(np.mean(places, axis=0))
    return int(middle.argmax()) if middle.any() else 2


def _scale(spec: mujoco.MjSpec, link: str, axis: int, length: float, thickness: float) -> None:
    """Stretch a body's geoms, and the places of what it carries, by `length` along the axis, `thickness` across it."""
    if length == thickness == 1.0:
        return
    scale = np.full(3, thickness)
    scale[axis] = length
    body = spec.body(link)
    for child in body.bodies:
        child.pos = child.pos * scale
    for geom in body.geoms:
        if not np.isnan(geom.mass):
            geom.mass *= scale.prod()
        if np.isnan(geom.fromto[0]):
            _scale_geom(geom, scale, axis)
        else:
            geom.fromto = geom.fromto * np.tile(scale, 2)
            geom.size[0] *= thickness


def _scale_geom(geom: mujoco.MjsGeom, scale: np.ndarray, axis: int) -> None:
    """A geom with a centre and a size. A ball that is stretched becomes a capsule; one that is flattened stays one."""
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, _quat(geom))
    along = np.linalg.norm(turn.reshape(3, 3) * scale[:, None], axis=0)  # how the geom's own axes are stretched
    geom.pos = geom.pos * scale
    across = scale[axis - 1]
    stretch = scale[axis] - across
    match geom.type:
        case mujoco.mjtGeom.mjGEOM_SPHERE if stretch > 0.0:
            geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
            geom.size = [geom.size[0] * across, geom.size[0] * stretch, 0.0]
            geom.alt.type, geom.alt.zaxis = mujoco.mjtOrientation.mjORIENTATION_ZAXIS, np.eye(3)[axis]
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            geom.size[0] *= across
        case mujoco.mjtGeom.mjGEOM_CAPSULE | mujoco.mjtGeom.mjGEOM_CYLINDER:
            geom.size = geom.size * [min(along[:2]), along[2], 1.0]
        case _:
            geom.size = geom.size * along


def _quat(geom: mujoco.MjsGeom) -> np.ndarray:
    """How a geom is turned in its body, by its `quat` or its `euler`."""
    quat = geom.quat.copy()
    if geom.alt.type == mujoco.mjtOrientation.mjORIENTATION_EULER:
        mujoco.mju_euler2Quat(quat, geom.alt.euler, "xyz")
    return quat


def _refuse_interpenetration(character: Character) -> None:
    model = character.model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for contact in data.contact:
        one, other = (model.body(model.geom_bodyid[geom]).name for geom in contact.geom)
        if contact.dist < -_TOUCH and "world" not in (one, other):
            depth = -100.0 * contact.dist
            raise SuiteError(f"body: {one} and {other} interpenetrate by {depth:.1f} cm at rest; take smaller factors")
