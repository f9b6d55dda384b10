"""Turns on the spot."""

import numpy as np

from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.skills.guard_pose import GUARD
from murmillo.envs.motion.authored.take import STANCE, Key, Take


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
