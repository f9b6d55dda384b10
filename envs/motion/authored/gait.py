"""Walking: footfalls and key poses from normal human timing.

At a natural pace a foot stands for about 60 % of a stride, and both are down for 10 % twice; the heel lands with the
toes up by about 20 degrees and leaves the ground well before the toes; the pelvis is lowest in double support, highest
over the standing leg, and turns about 5 degrees with the leading leg, against the shoulders (Winter 1991, Perry 1992).
"""

from murmillo.envs.motion.authored.body import Pose
from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.take import STANCE, Key

DOUBLE_SUPPORT = 0.10  # [s], of a stride of about 1 s
FIRST_FOOTFALL = 1.0  # [s]


def walk(pose: Pose, guard: Pose, *, strides: int, length: float, step_time: float) -> tuple[list[Key], list[Step]]:
    """From guard into an even walk and back to guard, straight ahead.

    Args:
        pose: how the body is carried; its height is that of double support [m].
        guard: the pose at both ends.
        strides: full strides, a right and a left step each, before the last two steps.
        length: of a step [m]; the mean speed is `length / step_time`.
        step_time: between two footfalls [s].
    """
    swing = step_time - DOUBLE_SUPPORT
    landing = FIRST_FOOTFALL
    x = STANCE["left"].x
    steps, keys = [], [Key(0.0, guard), Key(0.35, guard.but(weight=0.4, height=guard.height + 0.01))]
    for count in range(2 * strides):
        foot, side = ("right", -1.0) if count % 2 == 0 else ("left", 1.0)
        first, last = count == 0, count == 2 * strides - 1
        x += length * (0.65 if first else 0.85 if last else 1.0)
        steps.append(
            Step(
                foot,
                landing - swing - (0.06 if first else 0.0),
                landing,
                Place(x, 0.075 * side, 6.5 * side),
                lift=0.045,
                push=22.0 if first else 42.0,
                push_time=0.22,
                strike=18.0,
                flat_time=0.09,
            )
        )
        keys += _step_keys(pose, foot, landing, step_time)
        landing += step_time

    right = Place(x + 0.27, STANCE["right"].y, STANCE["right"].yaw)
    left = Place(right.x + STANCE["left"].x - STANCE["right"].x, STANCE["left"].y, STANCE["left"].yaw)
    end = landing + step_time + 0.05
    steps.append(Step("right", landing - swing, landing, right, lift=0.04, push=35.0, push_time=0.20, strike=6.0))
    steps.append(Step("left", end - swing, end, left, lift=0.04, push=28.0, push_time=0.18, strike=10.0))
    keys.append(Key(landing + 0.1, pose.but(height=0.5 * (pose.height + guard.height), weight=0.6)))
    keys.append(Key(end + 0.15, guard.but(height=guard.height - 0.02, weight=0.45)))
    keys += [Key(end + 0.6, guard), Key(end + 0.85, guard)]
    return keys, steps


def _step_keys(pose: Pose, foot: str, landing: float, step_time: float) -> list[Key]:
    """Two keys a step: passing over the standing leg, then the footfall."""
    side = 1.0 if foot == "right" else -1.0  # the right leg leads: the pelvis turns left, the shoulders right
    turned, tilted, level = pose.hips
    yaw, pitch, roll = pose.chest
    passing = pose.but(
        height=pose.height + 0.032,
        hips=(turned, tilted, level + 3.0 * side),  # the pelvis drops on the swinging side
        chest=(yaw, pitch - 1.0, roll - 1.0 * side),
    )
    footfall = pose.but(
        hips=(turned + 5.0 * side, tilted, level),
        chest=(yaw - 5.0 * side, pitch + 1.5, roll),
        hand=(pose.hand[0] - 0.035 * side, pose.hand[1], pose.hand[2] + 0.01 * side),
        shield=(pose.shield[0] + 0.02 * side, *pose.shield[1:]),
    )
    return [Key(landing - 0.5 * step_time, passing), Key(landing, footfall)]
