"""Gaits: footfalls, the steps between them, and key poses, from normal human timing.

Walking: at a natural pace a foot stands for about 60 % of a stride, and both are down for 10 % twice; the heel lands
with the toes up by about 20 degrees and leaves the ground well before the toes; the pelvis is lowest in double support,
highest over the standing leg, and turns about 5 degrees with the leading leg, against the shoulders (Winter 1991, Perry
1992). Running at 3.2 m/s: a foot stands for 39 % of a stride of 0.7 s and the body flies twice; in the swing the knee
bends to 90 degrees and the thigh rises to 40 (Novacheck 1998).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.interpolate import PchipInterpolator

from murmillo.envs.motion.authored.body import Pose
from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.leg import hanging
from murmillo.envs.motion.authored.take import Key

DOUBLE_SUPPORT = 0.10  # [s], of a stride of about 1 s
THIGH, SHIN = 0.4215, 0.4099  # [m]


@dataclass(frozen=True)
class Swing:
    """How a foot swings; the words are those of `feet.Step`.

    `legs` are moments of the swing, (phase, thigh, knee, toes-down pitch of the foot) [deg]: the thigh's rise ahead of
    the vertical and the knee's bend. A foot without them goes straight to its place.
    """

    lift: float = 0.045
    push: float = 14.0
    push_time: float = 0.14
    strike: float = 0.0
    flat_time: float = 0.10
    legs: tuple[tuple[float, float, float, float], ...] = ()


WALKING = Swing(lift=0.045, push=42.0, push_time=0.22, strike=18.0, flat_time=0.09)
RUNNING = Swing(
    push=48.0,
    push_time=0.16,
    strike=6.0,
    flat_time=0.06,
    legs=(
        (0.25, -4.0, 78.0, 82.0),
        (0.50, 24.0, 92.0, 66.0),
        (0.75, 43.0, 74.0, 30.0),
    ),
)


@dataclass(frozen=True)
class Footfall:
    """A foot lands at a time [s], `flight` after the other one left the ground; negative: both stand for so long."""

    foot: str
    time: float
    place: Place
    flight: float = -DOUBLE_SUPPORT
    swing: Swing = WALKING


@dataclass(frozen=True)
class Carriage:
    """How the body is carried from footfall to footfall: `pose` in the words of an animator, and what moves about it.

    `rise` is of the pelvis over the standing leg [m], `turn` and `counter` the yaw of pelvis and chest as a foot lands
    ahead, `drop` the roll of the pelvis towards the swinging leg [deg], `hand` and `shield` how far the arms swing
    forward and back [m]. `ahead` is 1 where feet land ahead of the other one, -1 where behind, 0 where beside.
    """

    pose: Pose
    rise: float = 0.032
    turn: float = 5.0
    counter: float = 5.0
    drop: float = 3.0
    hand: float = 0.05
    shield: float = 0.02
    ahead: float = 1.0


def steps_between(falls: Sequence[Footfall], start: float, height: float = 0.79) -> list[Step]:
    """The steps that lead to footfalls of alternate feet, the first of which leaves the ground at `start` [s].

    Args:
        height: of the hips above the ground while they swing a leg [m].
    """
    leaves = [start, *(fall.time - fall.flight for fall in falls)]
    middle = [0.5 * (fall.time + left) for fall, left in zip(falls[:-1], leaves[2:], strict=True)]
    way = PchipInterpolator([0.0, *middle, falls[-1].time], [0.0, *(fall.place.x for fall in falls)])
    steps = []
    for left, fall in zip(leaves[:-1], falls, strict=True):
        swing = fall.swing
        flow = []
        for phase, thigh, knee, pitch in swing.legs:
            time = left + phase * (fall.time - left)
            x, z = hanging(THIGH, SHIN, thigh, knee)
            flow.append((time, float(way(time)) + x, fall.place.y, height + z, pitch))
        steps.append(
            Step(
                fall.foot,
                left,
                fall.time,
                fall.place,
                lift=swing.lift,
                push=swing.push,
                push_time=swing.push_time,
                strike=swing.strike,
                flat_time=swing.flat_time,
                flow=tuple(flow),
            )
        )
    return steps


def keys_between(carriage: Carriage, falls: Sequence[Footfall]) -> list[Key]:
    """A key at each footfall and one as the body passes over the leg that stands before it."""
    keys = []
    for before, fall in zip([None, *falls[:-1]], falls, strict=True):
        passing, footfall = _step_poses(carriage, fall.foot)
        if before is not None:
            keys.append(Key(0.5 * (before.time + fall.time), passing))
        keys.append(Key(fall.time, footfall))
    return keys


def _step_poses(carriage: Carriage, foot: str) -> tuple[Pose, Pose]:
    """Passing over the standing leg before `foot` lands, and the footfall."""
    pose = carriage.pose
    side = 1.0 if foot == "right" else -1.0  # as the right leg lands ahead, the pelvis turns left, the shoulders right
    lead = side * carriage.ahead
    turned, tilted, level = pose.hips
    yaw, pitch, roll = pose.chest
    passing = pose.but(
        height=pose.height + carriage.rise,
        hips=(turned, tilted, level + carriage.drop * side),
        chest=(yaw, pitch - 1.0, roll - 0.4 * carriage.drop * side),
    )
    footfall = pose.but(
        hips=(turned + carriage.turn * lead, tilted, level),
        chest=(yaw - carriage.counter * lead, pitch + 1.5, roll),
        hand=(pose.hand[0] - carriage.hand * lead, pose.hand[1], pose.hand[2] + 0.25 * carriage.hand * lead),
        shield=(pose.shield[0] + carriage.shield * lead, *pose.shield[1:]),
    )
    return passing, footfall
