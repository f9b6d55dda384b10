"""Where the feet carry it: walks, steps and turns."""

import numpy as np

from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.gait import walk
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.take import STANCE, Key, Take


def walk_forward() -> Take:
    """Six steps at about 1.3 m/s, the arms steadied by sword and shield."""
    carried = GUARD.but(
        height=0.808,
        hips=(-3.0, 3.0, 0.0),
        chest=(-10.0, 1.0, 0.0),
        hand=(0.03, -0.30, -0.35),
        blade=(4.0, 24.0, 0.0),
        shield=(0.26, 0.16, -0.24),
        face=(22.0, 0.0, 25.0),
    )
    keys, steps = walk(carried, GUARD, strides=3, length=0.645, step_time=0.50)
    return Take("walk_forward", keys, steps, sway=0.15)


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


def _turn(label: str, angle: float) -> Take:
    first, second = ("left", "right") if angle > 0 else ("right", "left")
    half, side = 0.5 * angle, np.sign(angle)
    rise = GUARD.but(height=0.785)
    ready = GUARD.but(gaze=(30.0 * side, 0.0), chest=(-24.0 + 10.0 * side, 6.0, 0.0))
    return Take(
        label,
        [
            Key(0.0, GUARD),
            Key(0.40, ready.but(weight=0.42 if first == "right" else 0.58)),
            Key(0.90, rise.but(gaze=(25.0 * side, 0.0), chest=(-24.0 + 6.0 * side, 6.0, 0.0)), half * 0.75),
            Key(1.40, rise.but(gaze=(8.0 * side, 0.0)), angle * 0.70),
            Key(1.95, GUARD.but(height=0.765), angle),
            Key(2.6, GUARD, angle),
        ],
        [
            Step(first, 0.50, 0.90, _around(STANCE[first], half), 0.05, push=10.0),
            Step(second, 1.02, 1.42, _around(STANCE[second], angle), 0.05, push=12.0),
            Step(first, 1.54, 1.88, _around(STANCE[first], angle), 0.04, push=10.0),
        ],
    )


def _around(place: Place, angle: float) -> Place:
    """A foothold turned about the middle of the stance [deg]."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return Place(c * place.x - s * place.y, s * place.x + c * place.y, place.yaw + angle)
