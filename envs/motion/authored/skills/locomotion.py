"""Where the feet carry it: walks, runs, steps and turns."""

from collections.abc import Sequence

import numpy as np

from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.gait import (
    DOUBLE_SUPPORT,
    RUNNING,
    WALKING,
    Carriage,
    Footfall,
    Swing,
    keys_between,
    steps_between,
)
from murmillo.envs.motion.authored.skills.footwork import ahead
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.take import STANCE, Key, Take

CARRIED = GUARD.but(
    height=0.808,
    hips=(-3.0, 3.0, 0.0),
    chest=(-10.0, 1.0, 0.0),
    hand=(0.03, -0.30, -0.35),
    blade=(4.0, 24.0, 0.0),
    shield=(0.26, 0.16, -0.24),
    face=(22.0, 0.0, 25.0),
)
SETTLING = Swing(lift=0.04, push=20.0, push_time=0.18)


def walk_forward() -> Take:
    """Eight steps at about 1.3 m/s, the arms steadied by sword and shield."""
    lengths = [0.42, 0.60, *[0.65] * 5, 0.52]
    falls = _straight(lengths, first=1.0, beat=0.5, swing=WALKING, flight=-DOUBLE_SUPPORT)
    falls += _home(falls[-1], beat=0.5, swing=SETTLING)
    keys = [
        Key(0.0, GUARD),
        Key(0.35, GUARD.but(weight=0.4, height=0.778)),
        *keys_between(Carriage(CARRIED), falls[:-2]),
    ]
    return Take("walk_forward", keys + _settled(falls[-1].time), steps_between(falls, 0.54), sway=0.15)


def walk_backward() -> Take:
    """Eight steps of retreat at about 0.9 m/s, toes first, the eyes ahead over the shield."""
    wary = GUARD.but(height=0.782, hips=(-8.0, 5.0, 0.0), chest=(-18.0, 6.0, 0.0), shield=(0.32, 0.11, -0.17))
    toes_first = Swing(lift=0.05, push=8.0, push_time=0.12, strike=-12.0, flat_time=0.14)
    lengths = [-0.20, -0.36, *[-0.46] * 5, -0.40]
    falls = _straight(lengths, first=0.95, beat=0.52, swing=toes_first, flight=-0.13)
    falls += _home(falls[-1], beat=0.52, swing=toes_first)
    carriage = Carriage(wary, rise=0.02, turn=4.0, counter=4.0, hand=0.03, ahead=-1.0)
    keys = [Key(0.0, GUARD), Key(0.3, GUARD.but(weight=0.36, height=0.76)), *keys_between(carriage, falls[:-2])]
    return Take("walk_backward", keys + _settled(falls[-1].time), steps_between(falls, 0.5), sway=0.12)


def walk_left() -> Take:
    """Sidesteps to the left in guard, the left foot opening, the right one closing."""
    return _sidestep("walk_left", 1.0)


def walk_right() -> Take:
    """Sidesteps to the right in guard, the right foot opening, the left one closing."""
    return _sidestep("walk_right", -1.0)


def crouch_walk() -> Take:
    """Creeps forward with deep knees behind the shield at about 0.7 m/s, the sword held back."""
    low = GUARD.but(
        height=0.600,
        hips=(-10.0, 16.0, 0.0),
        chest=(-20.0, 30.0, 0.0),
        gaze=(0.0, 4.0),
        hand=(0.02, -0.34, -0.26),
        blade=(-4.0, 20.0, 0.0),
        shield=(0.38, 0.08, -0.16),
        face=(10.0, 8.0, 32.0),
    )
    creeping = Swing(lift=0.07, push=26.0, push_time=0.20, strike=8.0, flat_time=0.12)
    lengths = [0.30, *[0.42] * 4, 0.36]
    falls = _straight(lengths, first=1.25, beat=0.57, swing=creeping, flight=-0.16, width=0.10)
    falls += _home(falls[-1], beat=0.57, swing=SETTLING)
    carriage = Carriage(low, rise=0.012, turn=6.0, counter=6.0, drop=2.0, hand=0.03)
    keys = [Key(0.0, GUARD), Key(0.75, low.but(weight=0.40)), *keys_between(carriage, falls[:-2])]
    return Take("crouch_walk", keys + _settled(falls[-1].time), steps_between(falls, 0.80), sway=0.12)


def run_forward() -> Take:
    """From guard into a run at 3 m/s and back, the body flying between its steps."""
    running = GUARD.but(
        height=0.727,
        hips=(-2.0, 9.0, 0.0),
        chest=(-6.0, 13.0, 0.0),
        hand=(0.02, -0.32, -0.30),
        blade=(-4.0, 38.0, 0.0),
        shield=(0.28, 0.16, -0.20),
        face=(26.0, 0.0, 28.0),
    )
    braking = CARRIED.but(height=0.705, hips=(-6.0, 0.0, 0.0), chest=(-14.0, -2.0, 0.0))
    # Frames of 1/30 s. It brakes in short quick steps, for a long one would lock the knee.
    beats = [0.0, 12.0, 11.0, *[10.0] * 5, 9.0, 9.0, 9.0, 10.0, 11.0, 12.0]
    lengths = [0.46, 0.67, 0.88, 1.02, 1.01, 0.97, 0.93, 0.88, 0.78, 0.66, 0.55, 0.44, 0.34, 0.26]
    flights = [-2.0, 1.0, 3.0, *[4.0] * 5, 3.0, 2.0, 1.0, -1.0, -2.0, -3.0]
    braked = Swing(lift=0.06, push=30.0, push_time=0.16, strike=10.0, flat_time=0.08)
    falls = _straight(
        lengths,
        first=0.9,
        beat=np.array(beats) / 30.0,
        swing=[Swing(lift=0.08, push=40.0, push_time=0.18, strike=4.0), *[RUNNING] * 9, *[braked] * 4],
        flight=np.array(flights) / 30.0,
        width=0.05,
        toe_out=4.0,
    )
    falls += _home(falls[-1], beat=0.42, swing=SETTLING)
    carriage = Carriage(running, rise=0.0, turn=8.0, counter=12.0, drop=3.0, hand=0.10, shield=0.03)
    keys = [
        Key(0.0, GUARD),
        Key(0.4, GUARD.but(weight=0.40, height=0.74, hips=(-10.0, 8.0, 0.0), chest=(-22.0, 16.0, 0.0))),
        *keys_between(carriage, falls[:7]),
        *keys_between(Carriage(braking, rise=0.0, turn=7.0, counter=9.0, hand=0.07), falls[7:-2]),
    ]
    return Take("run_forward", keys + _settled(falls[-1].time), steps_between(falls, 0.5), sway=0.10)


def run_backward() -> Take:
    """Backpedals at 2 m/s on the balls of the feet, behind the shield."""
    fleeing = GUARD.but(height=0.716, hips=(-8.0, 8.0, 0.0), chest=(-18.0, 14.0, 0.0), shield=(0.33, 0.10, -0.17))
    springy = Swing(lift=0.09, push=26.0, push_time=0.12, strike=-20.0, flat_time=0.12)
    beats = [0.0, 12.0, 11.0, *[10.0] * 8, 12.0, 13.0]
    lengths = [-0.06, -0.18, -0.34, -0.50, -0.60, *[-0.68] * 5, -0.60, -0.46, -0.36]
    flights = [-2.0, -2.0, 0.0, 1.0, *[2.0] * 7, -1.0, -3.0]
    falls = _straight(lengths, first=0.85, beat=np.array(beats) / 30.0, swing=springy, flight=np.array(flights) / 30.0)
    falls = falls[:-1] + _home(falls[-2], beat=0.42, swing=Swing(lift=0.05, push=8.0, strike=-10.0))
    carriage = Carriage(fleeing, rise=0.0, turn=6.0, counter=7.0, drop=2.0, hand=0.05, ahead=-1.0)
    keys = [
        Key(0.0, GUARD),
        Key(0.3, GUARD.but(weight=0.34, height=0.74)),
        *keys_between(carriage, falls[:-3]),
    ]
    return Take("run_backward", keys + _settled(falls[-1].time), steps_between(falls, 0.5), sway=0.08)


def run_left() -> Take:
    """Gallops sideways to the left at 1.9 m/s: the right leg thrusts, the body flies, the feet never cross."""
    return _gallop("run_left", 1.0)


def run_right() -> Take:
    """Gallops sideways to the right at 1.9 m/s: the left leg thrusts, the body flies, the feet never cross."""
    return _gallop("run_right", -1.0)


def step_back() -> Take:
    """Two guarded steps of retreat, the rear foot first, the shield never dropping."""
    keys, steps, time = [Key(0.0, GUARD), Key(0.3, GUARD.but(weight=0.40, height=0.755))], [], 0.35
    low = GUARD.but(height=0.750, chest=(-26.0, 9.0, 0.0), shield=(0.35, 0.08, -0.15))
    for count in (1, 2):
        back = -0.34 * count
        steps += [
            Step("right", time, time + 0.34, Place(RIGHT.x + back, RIGHT.y, RIGHT.yaw), 0.045, push=8.0),
            Step("left", time + 0.46, time + 0.80, Place(LEFT.x + back, LEFT.y, LEFT.yaw), 0.045, push=10.0),
        ]
        keys += [Key(time + 0.36, low.but(weight=0.55)), Key(time + 0.80, low.but(height=0.765, weight=0.55))]
        time += 1.05
    keys += [Key(time + 0.35, GUARD.but(weight=0.46, height=0.762)), Key(time + 0.7, GUARD)]
    return Take("step_back", keys, steps)


def turn_left_90() -> Take:
    """A quarter turn to the left in three steps, the head leading."""
    return _turn("turn_left_90", 90.0)


def turn_right_90() -> Take:
    """A quarter turn to the right in three steps, the head leading."""
    return _turn("turn_right_90", -90.0)


def turn_left_180() -> Take:
    """About-face over the left shoulder in five steps, the head leading."""
    return _turn("turn_left_180", 180.0)


def turn_right_180() -> Take:
    """About-face over the right shoulder in five steps, the head leading."""
    return _turn("turn_right_180", -180.0)


def _straight(
    lengths: Sequence[float],
    *,
    first: float,
    beat: float | np.ndarray,
    swing: Swing | Sequence[Swing],
    flight: float | np.ndarray,
    width: float = 0.075,
    toe_out: float = 6.5,
) -> list[Footfall]:
    """Alternate footfalls straight ahead, the right foot first, which lands at `first` [s].

    Args:
        lengths: of the steps [m], negative for backwards.
        beat: [s] from footfall to footfall; one for all or one for each.
        swing, flight: of `Footfall`; one for all or one for each.
        width: of each foot from the line [m].
        toe_out: yaw of the feet [deg].
    """
    count = len(lengths)
    beats = np.broadcast_to(beat, count)
    times = first + np.cumsum(beats) - beats[0]
    flights = np.broadcast_to(flight, count)
    swings = [swing] * count if isinstance(swing, Swing) else swing
    # each step is measured from the foot that stands ahead; backwards, from the one that stands behind
    x = (LEFT.x if lengths[0] > 0.0 else RIGHT.x) + np.cumsum(lengths)
    falls = []
    for i in range(count):
        foot, side = ("right", -1.0) if i % 2 == 0 else ("left", 1.0)
        place = Place(float(x[i]), width * side, toe_out * side)
        falls.append(Footfall(foot, float(times[i]), place, float(flights[i]), swings[i]))
    return falls


def _home(last: Footfall, *, beat: float, swing: Swing) -> list[Footfall]:
    """Two more steps, right and left, into the stance of guard, from a last footfall of the left foot."""
    x = last.place.x + (0.27 if last.place.x > 0.0 else -0.30) - RIGHT.x
    return [
        Footfall("right", last.time + beat, ahead(RIGHT, x), swing=swing),
        Footfall("left", last.time + 2.0 * beat + 0.05, ahead(LEFT, x), swing=swing),
    ]


def _settled(landed: float) -> list[Key]:
    """The knees give as the last foot lands [s], then guard."""
    given = GUARD.but(height=0.748, weight=0.45, chest=(-23.0, 8.0, 0.0), hand=(0.10, -0.30, -0.30))
    return [Key(landed + 0.12, given), Key(landed + 0.62, GUARD), Key(landed + 0.85, GUARD)]


def _sidestep(label: str, side: float) -> Take:
    opening, closing = ("left", "right") if side > 0.0 else ("right", "left")
    swing = Swing(lift=0.04, push=9.0, push_time=0.14)
    falls, time = [], 0.75
    for count in range(1, 6):
        y = 0.36 * side * count
        falls.append(Footfall(opening, time, ahead(STANCE[opening], 0.0, y), -0.12, swing))
        falls.append(Footfall(closing, time + 0.44, ahead(STANCE[closing], 0.0, y), -0.12, swing))
        time += 0.92
    wide = GUARD.but(
        height=0.735, hips=(-14.0, 5.0, 2.0 * side), chest=(-22.0, 8.0, -2.0 * side), gaze=(6.0 * side, 0.0)
    )
    closed = GUARD.but(
        height=0.768, hips=(-13.0, 4.0, -1.0 * side), chest=(-25.0, 6.0, 1.0 * side), gaze=(6.0 * side, 0.0),
        hand=(0.11, -0.30, -0.275), shield=(0.325, 0.09, -0.16),
    )  # fmt: skip
    ready = GUARD.but(weight=0.5 + 0.16 * side, height=0.755, gaze=(8.0 * side, 0.0))
    keys = [Key(0.0, GUARD), Key(0.35, ready)]
    keys += [Key(fall.time, wide if fall.foot == opening else closed) for fall in falls]
    return Take(label, keys + _settled(falls[-1].time), steps_between(falls, 0.42), sway=0.10)


def _gallop(label: str, side: float) -> Take:
    opening, closing = ("left", "right") if side > 0.0 else ("right", "left")
    swing = Swing(lift=0.055, push=20.0, push_time=0.14, strike=-6.0, flat_time=0.09)
    # Frames of 1/30 s: how long the body flies on to the opening foot, and how soon the closing one follows.
    slow, hopping = [(0.32, -2.0, 9.0), (0.50, 0.0, 6.0), (0.62, 2.0, 4.0)], (0.77, 3.0, 4.0)
    cycles = [*slow, *[hopping] * 5, (0.72, 3.0, 4.0), *reversed(slow)]
    falls, frame, y = [], 25.0, 0.0
    for count, (advance, flight, follows) in enumerate(cycles, 1):
        y += advance * side
        # The feet come nearly abreast, for the legs are too short to straddle both ways.
        abreast = 0.0 if count == len(cycles) else 0.09
        spots = {"left": ahead(LEFT, -abreast, y), "right": ahead(RIGHT, abreast, y)}
        falls.append(Footfall(opening, frame / 30.0, spots[opening], flight / 30.0, swing))
        frame += follows
        falls.append(Footfall(closing, frame / 30.0, spots[closing], -2.0 / 30.0, swing))
        frame += 8.0
    flying = GUARD.but(
        height=0.694, hips=(-14.0, 6.0, 3.0 * side), chest=(-22.0, 10.0, -2.0 * side), gaze=(14.0 * side, 0.0),
        hand=(0.08, -0.34, -0.26), shield=(0.32, 0.12, -0.15),
    )  # fmt: skip
    gathered = flying.but(
        height=0.684, hips=(-14.0, 6.0, -2.0 * side), chest=(-24.0, 12.0, 2.0 * side), hand=(0.09, -0.31, -0.29),
        shield=(0.33, 0.10, -0.18),
    )  # fmt: skip
    ready = GUARD.but(weight=0.5 + 0.16 * side, height=0.73, gaze=(16.0 * side, 0.0))
    keys = [Key(0.0, GUARD), Key(0.35, ready)]
    keys += [Key(fall.time, flying if fall.foot == opening else gathered) for fall in falls]
    return Take(label, keys + _settled(falls[-1].time), steps_between(falls, 0.5), sway=0.08)


def _turn(label: str, angle: float) -> Take:
    first, second = ("left", "right") if angle > 0 else ("right", "left")
    side = np.sign(angle)
    quarters = round(abs(angle) / 90.0)
    rise = GUARD.but(height=0.785)
    keys = [
        Key(0.0, GUARD),
        Key(
            0.40,
            GUARD.but(
                gaze=(38.0 * side, 0.0), chest=(-24.0 + 12.0 * side, 6.0, 0.0), hips=(-14.0 + 4.0 * side, 4.0, 0.0),
                weight=0.42 if first == "right" else 0.58,
            ),
        ),
    ]  # fmt: skip
    steps, time = [], 0.50
    for quarter in range(quarters):
        turned, last = 90.0 * side * quarter, quarter == quarters - 1
        steps += [
            Step(first, time, time + 0.38, _around(STANCE[first], turned + 45.0 * side), 0.05, push=12.0),
            Step(second, time + 0.50, time + 0.88, _around(STANCE[second], turned + 90.0 * side), 0.05, push=14.0),
        ]
        keys += [
            Key(
                time + 0.40,
                rise.but(gaze=(28.0 * side, 0.0), chest=(-24.0 + 8.0 * side, 6.0, 0.0)),
                turned + 34.0 * side,
            ),
            Key(
                time + 0.88,
                rise.but(
                    gaze=((8.0 if last else 30.0) * side, 0.0), chest=(-24.0 + (2.0 if last else 8.0) * side, 6.0, 0.0)
                ),
                turned + 66.0 * side,
            ),
        ]
        time += 1.02
    steps.append(Step(first, time + 0.02, time + 0.38, _around(STANCE[first], angle), 0.04, push=10.0))
    keys += [Key(time + 0.44, GUARD.but(height=0.758, weight=0.47), angle), Key(time + 1.1, GUARD, angle)]
    return Take(label, keys, steps)


def _around(place: Place, angle: float) -> Place:
    """A foothold turned about the middle of the stance [deg]."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return Place(c * place.x - s * place.y, s * place.x + c * place.y, place.yaw + angle)
