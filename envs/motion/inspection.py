"""What is suspicious about a clip, and at which frame: what a person would look for before learning from it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from murmillo.envs.character import Character
from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.ground import GROUNDED, Ground, ground_of
from murmillo.envs.motion.measures import TRACKED, beyond_limits, joint_coordinates, tracking_error, velocities
from murmillo.envs.rotations import heading_quat, quat_rotate_inverse

_Floats = NDArray[np.float64]

SLIDE = 0.01  # of a sole on the ground [m a control step]
STANCE = 0.15  # a foot that is on the ground for less does not stand [s]
SUNK = 0.01  # below the ground [m]
NEAR = 0.03  # a body lower than this may bear the weight [m]
AIRBORNE = 0.9  # no jump lasts longer: its top would be a metre high [s]
BEYOND = 0.05  # over the limit of a joint [rad]
SPEED = 25.0  # of a joint [rad/s]
JUMP = 25.0  # of a joint's velocity between two frames [rad/s]
ROOT_SPEED = 12.5  # a sprinter's record is 12.4 [m/s]
OPEN = 0.1  # between the ends of a loop, of any joint [rad] or of the root's height [m]
FROZEN = 0.25  # no living body keeps still to the last digit for longer [s]
REPEATED = 0.2  # share of frames that equal the one before
STILL = 1e-9  # frames that differ by less are the same
REST = 0.03  # every joint nearer to zero than this: the rest pose, not a motion [rad]
LEVEL, STRAIGHT = 0.2, 0.95  # a T-pose's arms: height between shoulder and hand, reach to the side; in arm lengths
TRACKING_EVERY = 3  # frames from one start of a simulation to the next
TRACKABLE = 0.9  # share of frames from which PD targets follow the clip


@dataclass(frozen=True)
class Suspicion:
    """`check` found something at `frame`; `what` says it in words, with the figure."""

    check: str
    frame: int
    what: str


def inspect(clip: Clip, character: Character, tracking: bool = False) -> list[Suspicion]:
    """What is suspicious about a clip: the worst of each kind of fault, in the order of the frames.

    Args:
        tracking: simulate as well whether PD targets can follow the clip; this is slow.
    """
    look = _Look(clip, character, ground_of(clip, character), joint_coordinates(clip, character))
    checks = (*_CHECKS, _tracking) if tracking else _CHECKS
    return sorted((found for check in checks for found in check(look)), key=lambda found: found.frame)


@dataclass(frozen=True)
class _Look:
    """A clip with what several checks need: `joints` are its coordinates [F, A] [rad]."""

    clip: Clip
    character: Character
    ground: Ground
    joints: _Floats

    def joint(self, column: int) -> str:
        """Name of the joint to which this coordinate belongs."""
        return next(joint.name for joint in self.character.joints if column < joint.action.stop)


def _slide(look: _Look) -> Iterator[Suspicion]:
    """A foot that stands should stay; one that brushes the ground in passing is a fault of another kind."""
    ground = look.ground
    stands = np.stack([_lasting(low, look.clip.fps * STANCE) for low in (ground.sole_height < GROUNDED).T], axis=1)
    stands = stands[1:] & stands[:-1]
    for check, slide, fault in (
        ("slide", ground.slide * stands, "stands but slides"),
        ("scuff", ground.slide * ~stands, "brushes the ground and moves"),
    ):
        frame, point = _peak(slide)
        if (worst := slide[frame, point]) > SLIDE:
            yield Suspicion(check, frame, f"the {ground.feet[point]} {fault} {100 * worst:.1f} cm in a control step")


def _sunk(look: _Look) -> Iterator[Suspicion]:
    frame, geom = _peak(-look.ground.height)
    if (worst := -look.ground.height[frame, geom]) > SUNK:
        yield Suspicion("ground", frame, f"the {look.ground.bodies[geom]} is {100 * worst:.1f} cm below the ground")


def _floating(look: _Look) -> Iterator[Suspicion]:
    lowest = look.ground.height.min(axis=1)
    if (closest := float(lowest.min())) > NEAR:
        yield Suspicion("floating", int(lowest.argmin()), f"it never comes nearer to the ground than {closest:.2f} m")
        return
    start, length = _longest_run(lowest > NEAR)
    if length / look.clip.fps > AIRBORNE:
        height, seconds = lowest[start : start + length].max(), length / look.clip.fps
        yield Suspicion("floating", start, f"it hangs up to {height:.2f} m above the ground for {seconds:.1f} s")
        return
    for foot in look.character.feet:
        soles = look.ground.sole_height[:, [name == foot for name in look.ground.feet]].min(axis=1)
        if soles.min() > NEAR and look.clip.duration > AIRBORNE:
            text = f"the {foot} never touches the ground, {soles.min():.2f} m at its lowest"
            yield Suspicion("foot", int(soles.argmin()), text)


def _limits(look: _Look) -> Iterator[Suspicion]:
    excess = beyond_limits(look.joints, look.character)
    frame, column = _peak(excess)
    if (worst := excess[frame, column]) > BEYOND:
        text = f"the {look.joint(column)} is {np.degrees(worst):.0f} degrees beyond its limit"
        yield Suspicion("limits", frame, text)


def _speed(look: _Look) -> Iterator[Suspicion]:
    rates = np.abs(velocities(look.clip, look.character)[:, 6:])
    frame, column = _peak(rates)
    if rates[frame, column] > SPEED:
        text = f"the {look.joint(column)} turns at {rates[frame, column]:.0f} rad/s"
        yield Suspicion("speed", frame, text)


def _jump(look: _Look) -> Iterator[Suspicion]:
    rates = velocities(look.clip, look.character)[:-1, 6:]  # the last row repeats the one before
    change = np.abs(np.diff(rates, axis=0))
    if len(change) == 0:
        return
    frame, column = _peak(change)
    if change[frame, column] > JUMP:
        text = f"the {look.joint(column)} changes its speed by {change[frame, column]:.0f} rad/s within a frame"
        yield Suspicion("jump", frame + 1, text)


def _root_jump(look: _Look) -> Iterator[Suspicion]:
    step = np.linalg.norm(np.diff(look.clip.qpos[:, :3], axis=0), axis=1)
    frame = int(step.argmax())
    if (speed := step[frame] * look.clip.fps) > ROOT_SPEED:
        text = f"the root leaps {step[frame]:.2f} m in a frame, which is {speed:.0f} m/s"
        yield Suspicion("leap", frame + 1, text)


def _loop(look: _Look) -> Iterator[Suspicion]:
    if not look.clip.loop:
        return
    gap = np.abs(look.joints[-1] - look.joints[0])
    height = abs(float(look.clip.qpos[-1, 2] - look.clip.qpos[0, 2]))
    last = look.clip.frames - 1
    if gap.max() > OPEN:
        joint = look.joint(int(gap.argmax()))
        yield Suspicion("loop", last, f"is marked as a loop, but its ends differ by {gap.max():.2f} rad at the {joint}")
    elif height > OPEN:
        yield Suspicion("loop", last, f"is marked as a loop, but its ends differ by {height:.2f} m in height")


def _rest_pose(look: _Look) -> Iterator[Suspicion]:
    """A T-pose or the rest pose at either end is the recording's calibration, left in the clip."""
    rest = np.abs(look.joints).max(axis=1) < REST
    pose = np.where(rest, "the rest pose", np.where(_arms_out(look), "a T-pose", ""))
    for frame, verb in ((0, "begins"), (look.clip.frames - 1, "ends")):
        if pose[frame]:
            yield Suspicion("rest pose", frame, f"it {verb} in {pose[frame]}; `murmillo motions trim` cuts it off")
            return


def _arms_out(look: _Look) -> NDArray[np.bool_]:
    """[F] whether both arms are held out level, straight and to the sides of the chest."""
    character, qpos = look.character, torch.from_numpy(look.clip.qpos.copy())
    hands = character.body_ids(("right_hand", "left_hand"))
    parents = character.model.body_parentid[1:] - 1
    shoulders = [int(parents[parents[hand]]) for hand in hands]
    offset = character.model.body_pos[1:]
    pos_w, quat_w = character.forward_kinematics(qpos)
    arm = quat_rotate_inverse(heading_quat(quat_w[:, :1]), pos_w[:, hands] - pos_w[:, shoulders]).numpy()
    length = [np.linalg.norm(offset[hand]) + np.linalg.norm(offset[parents[hand]]) for hand in hands]
    to_side = arm[..., 1] * np.array([-1.0, 1.0]) / length  # y is to the left
    level = np.abs(arm[..., 2]) / length < LEVEL
    return np.all(level & (to_side > STRAIGHT), axis=1)


def _frozen(look: _Look) -> Iterator[Suspicion]:
    same = np.abs(np.diff(look.clip.qpos, axis=0)).max(axis=1) < STILL
    start, length = _longest_run(same)
    if length / look.clip.fps > FROZEN:
        text = f"nothing at all moves for {length / look.clip.fps:.1f} s"
        yield Suspicion("frozen", start, text)
    elif same.mean() > REPEATED:
        text = f"{100 * same.mean():.0f} % of the frames repeat the one before; is {look.clip.fps:g} fps its true rate?"
        yield Suspicion("repeats", int(same.argmax()), text)


def _tracking(look: _Look) -> Iterator[Suspicion]:
    error = tracking_error(look.clip, look.character, TRACKING_EVERY)
    share = float(np.mean(error < TRACKED))
    if share < TRACKABLE:
        worst = int(error.argmax())
        text = f"PD targets follow {100 * share:.0f} % of it; here their mean joint error is {error[worst]:.2f} rad"
        yield Suspicion("tracking", TRACKING_EVERY * worst, text)


_CHECKS = (
    _slide,
    _sunk,
    _floating,
    _limits,
    _speed,
    _jump,
    _root_jump,
    _loop,
    _rest_pose,
    _frozen,
)


def _peak(values: _Floats) -> tuple[int, int]:
    """Frame and column of the largest of values [F, D]."""
    frame, column = np.unravel_index(values.argmax(), values.shape)
    return int(frame), int(column)


def _runs(flags: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Starts and lengths of the runs of true among flags [F]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2] - edges[::2]


def _longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Start and length of the longest run of true among flags [F]; (0, 0) where none is."""
    starts, lengths = _runs(flags)
    if len(starts) == 0:
        return 0, 0
    longest = int(lengths.argmax())
    return int(starts[longest]), int(lengths[longest])


def _lasting(flags: NDArray[np.bool_], frames: float) -> NDArray[np.bool_]:
    """The flags [F] of the runs that last at least so many frames."""
    kept = np.zeros_like(flags)
    for start, length in zip(*_runs(flags), strict=True):
        kept[start : start + length] = length >= frames
    return kept
