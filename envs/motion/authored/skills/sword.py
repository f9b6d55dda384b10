"""What the sword does: slashes and thrusts, each with anticipation, strike and recovery."""

from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT
from murmillo.envs.motion.authored.take import Key, Take


def slash_down() -> Take:
    """From over the right shoulder down through the middle, with a short step of the leading foot."""
    wound = GUARD.but(
        height=0.785,
        weight=0.64,
        hips=(-26.0, 1.0, 1.0),
        chest=(-42.0, -3.0, 3.0),
        hand=(-0.06, -0.33, 0.17),
        blade=(12.0, 115.0, 0.0),
        shield=(0.36, 0.05, -0.10),
        face=(2.0, 0.0, 35.0),
    )
    cut = GUARD.but(
        height=0.745,
        weight=0.30,
        hips=(2.0, 7.0, 0.0),
        chest=(14.0, 12.0, 0.0),
        hand=(0.50, -0.12, -0.08),
        blade=(2.0, 22.0, 0.0),
        shield=(0.20, 0.26, -0.22),
        face=(42.0, 0.0, 30.0),
    )
    through = cut.but(
        height=0.735,
        chest=(24.0, 20.0, -2.0),
        hand=(0.38, -0.02, -0.40),
        blade=(14.0, -38.0, 8.0),
        shield=(0.12, 0.34, -0.24),
        face=(62.0, 0.0, 25.0),
    )
    return Take(
        "slash_down",
        [
            Key(0.0, GUARD),
            Key(0.46, wound),
            Key(0.56, wound.but(weight=0.5, hips=(-16.0, 3.0, 0.0), chest=(-36.0, 0.0, 2.0), hand=(0.02, -0.32, 0.20))),
            Key(0.74, cut),
            Key(0.86, through),
            Key(1.06, through.but(hand=(0.33, 0.0, -0.43), chest=(26.0, 21.0, -2.0), weight=0.34)),
            Key(1.65, GUARD.but(weight=0.56)),
            Key(2.2, GUARD),
        ],
        [
            Step(
                "left", 0.50, 0.74, Place(LEFT.x + 0.14, LEFT.y, LEFT.yaw), 0.04, push=6.0, strike=8.0, flat_time=0.06
            ),
            Step("left", 1.20, 1.52, LEFT, 0.035, push=8.0),
        ],
    )


def slash_left() -> Take:
    """A level cut from the right to the left, the edge leading, the shield drawn away as a counterweight."""
    wound = GUARD.but(
        height=0.765,
        weight=0.64,
        hips=(-30.0, 3.0, 0.0),
        chest=(-52.0, 4.0, 2.0),
        hand=(-0.04, -0.46, -0.03),
        blade=(-85.0, 35.0, 60.0),
        shield=(0.36, 0.02, -0.12),
        face=(-4.0, 0.0, 32.0),
    )
    cut = GUARD.but(
        height=0.745,
        weight=0.34,
        hips=(4.0, 5.0, 0.0),
        chest=(14.0, 9.0, 0.0),
        hand=(0.48, -0.14, -0.12),
        blade=(-8.0, 2.0, 85.0),
        shield=(0.14, 0.32, -0.20),
        face=(55.0, 0.0, 28.0),
    )
    through = cut.but(
        height=0.75,
        chest=(34.0, 10.0, -2.0),
        hips=(10.0, 4.0, 0.0),
        hand=(0.40, 0.10, -0.10),
        blade=(72.0, 2.0, 85.0),
        shield=(0.02, 0.36, -0.26),
        face=(85.0, 0.0, 15.0),
    )
    return Take(
        "slash_left",
        [
            Key(0.0, GUARD),
            Key(0.48, wound),
            Key(
                0.58, wound.but(weight=0.5, hips=(-20.0, 4.0, 0.0), chest=(-42.0, 5.0, 1.0), blade=(-88.0, 22.0, 75.0))
            ),
            Key(0.76, cut),
            Key(0.90, through),
            Key(1.08, through.but(chest=(37.0, 10.0, -2.0), weight=0.38, blade=(80.0, 0.0, 80.0))),
            Key(1.75, GUARD.but(weight=0.54)),
            Key(2.3, GUARD),
        ],
        [
            Step("left", 0.52, 0.76, Place(LEFT.x + 0.10, LEFT.y + 0.03, LEFT.yaw + 6.0), 0.035, push=6.0, strike=6.0),
            Step("left", 1.25, 1.58, LEFT, 0.035, push=8.0),
        ],
    )


def slash_right() -> Take:
    """The backhand: coiled over the shield arm, then level from the left to the right."""
    wound = GUARD.but(
        height=0.755,
        weight=0.36,
        hips=(2.0, 6.0, 0.0),
        chest=(20.0, 10.0, -2.0),
        gaze=(-4.0, 0.0),
        hand=(0.24, 0.14, 0.02),
        blade=(130.0, 30.0, -50.0),
        shield=(0.12, 0.36, -0.26),
        face=(70.0, 0.0, 20.0),
    )
    cut = GUARD.but(
        height=0.745,
        weight=0.52,
        hips=(-18.0, 5.0, 0.0),
        chest=(-20.0, 8.0, 0.0),
        hand=(0.46, -0.26, -0.10),
        blade=(8.0, 2.0, -80.0),
        shield=(0.22, 0.28, -0.20),
        face=(42.0, 0.0, 28.0),
    )
    through = cut.but(
        weight=0.60,
        hips=(-24.0, 4.0, 0.0),
        chest=(-44.0, 6.0, 2.0),
        gaze=(4.0, 0.0),
        hand=(0.22, -0.56, -0.12),
        blade=(-78.0, 2.0, -75.0),
        shield=(0.34, 0.12, -0.14),
        face=(10.0, 0.0, 32.0),
    )
    return Take(
        "slash_right",
        [
            Key(0.0, GUARD),
            Key(0.50, wound),
            Key(0.60, wound.but(weight=0.42, hips=(-6.0, 6.0, 0.0), chest=(10.0, 9.0, -1.0))),
            Key(0.78, cut),
            Key(0.92, through),
            Key(1.10, through.but(chest=(-47.0, 6.0, 2.0), blade=(-86.0, 0.0, -70.0))),
            Key(1.75, GUARD.but(weight=0.48)),
            Key(2.3, GUARD),
        ],
    )


def stab() -> Take:
    """A straight thrust from the hip, the body behind it in a lunge."""
    drawn = GUARD.but(
        height=0.765,
        weight=0.66,
        hips=(-24.0, 3.0, 0.0),
        chest=(-40.0, 4.0, 0.0),
        hand=(-0.12, -0.33, -0.27),
        blade=(-1.0, 8.0, 0.0),
        shield=(0.36, 0.10, -0.12),
        face=(6.0, 0.0, 32.0),
    )
    thrust = GUARD.but(
        height=0.715,
        weight=0.26,
        hips=(4.0, 7.0, 0.0),
        chest=(22.0, 10.0, 0.0),
        hand=(0.58, -0.10, -0.12),
        blade=(1.0, 4.0, 25.0),
        shield=(0.16, 0.30, -0.22),
        face=(50.0, 0.0, 28.0),
    )
    return Take(
        "stab",
        [
            Key(0.0, GUARD),
            Key(0.42, drawn),
            Key(
                0.52, drawn.but(weight=0.5, hips=(-14.0, 4.0, 0.0), chest=(-34.0, 5.0, 0.0), hand=(-0.08, -0.33, -0.26))
            ),
            Key(0.72, thrust),
            Key(0.86, thrust.but(hand=(0.56, -0.10, -0.13), weight=0.3)),
            Key(1.45, GUARD.but(weight=0.56)),
            Key(2.0, GUARD),
        ],
        [
            Step(
                "left", 0.46, 0.72, Place(LEFT.x + 0.24, LEFT.y, LEFT.yaw), 0.04, push=6.0, strike=10.0, flat_time=0.06
            ),
            Step("left", 1.02, 1.36, LEFT, 0.04, push=10.0),
        ],
    )
