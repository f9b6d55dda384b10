"""The skills, each a short score of key poses and steps. All begin and end in guard, so that they compose."""

from collections.abc import Callable

import numpy as np

from murmillo.envs.motion.authored.body import Pose
from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.gait import walk
from murmillo.envs.motion.authored.take import STANCE, Key, Take

GUARD = Pose()
LEFT, RIGHT = STANCE["left"], STANCE["right"]


def guard() -> Take:
    """Breathing in guard, the load passing from leg to leg; closes on itself."""
    breath_in = {"chest": (-24.0, 4.5, 0.0), "hand": (0.10, -0.30, -0.285), "shield": (0.33, 0.09, -0.165)}
    return Take(
        "guard",
        [
            Key(0.0, GUARD),
            Key(0.9, GUARD.but(weight=0.62, height=0.772, hips=(-16.0, 4.0, 2.0), gaze=(3.0, -1.0), **breath_in)),
            Key(2.0, GUARD.but(weight=0.46, height=0.762, chest=(-23.0, 7.0, -1.0), blade=(6.0, 28.0, 0.0))),
            Key(3.0, GUARD.but(weight=0.38, height=0.770, hips=(-12.0, 4.0, -2.0), gaze=(-3.0, 0.0), **breath_in)),
            Key(4.0, GUARD),
        ],
        loop=True,
    )


def idle() -> Take:
    """Lowers the arms, stands at ease for a few breaths, looks about, takes guard again."""
    ease = GUARD.but(
        height=0.815,
        weight=0.56,
        hips=(-12.0, 1.0, 2.0),
        chest=(-12.0, 1.0, -1.0),
        gaze=(0.0, -2.0),
        hand=(0.02, -0.30, -0.47),
        blade=(-6.0, -30.0, 0.0),
        shield=(0.16, 0.30, -0.36),
        face=(48.0, 0.0, 12.0),
    )
    breath = ease.but(chest=(-12.0, -1.0, -1.0), hand=(0.02, -0.30, -0.462), shield=(0.165, 0.30, -0.35))
    return Take(
        "idle",
        [
            Key(0.0, GUARD),
            Key(1.0, ease),
            Key(1.9, breath.but(gaze=(24.0, 0.0), weight=0.52)),
            Key(2.9, ease.but(gaze=(-8.0, 0.0), weight=0.44, hips=(-12.0, 1.0, -1.5))),
            Key(3.7, breath.but(gaze=(-20.0, 0.0), weight=0.5)),
            Key(4.9, GUARD),
        ],
    )


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


def shield_bash() -> Take:
    """Coils behind the shield and drives it forward with the leading leg."""
    coiled = GUARD.but(
        height=0.745,
        weight=0.66,
        hips=(-6.0, 6.0, 0.0),
        chest=(-4.0, 10.0, 0.0),
        hand=(0.10, -0.32, -0.28),
        blade=(-3.0, 30.0, 0.0),
        shield=(0.26, 0.14, -0.19),
        face=(16.0, 0.0, 40.0),
    )
    driven = GUARD.but(
        height=0.74,
        weight=0.24,
        hips=(-26.0, 8.0, 0.0),
        chest=(-46.0, 12.0, 0.0),
        hand=(-0.10, -0.36, -0.27),
        blade=(-10.0, 30.0, 0.0),
        shield=(0.50, 0.03, -0.06),
        face=(4.0, 4.0, 48.0),
    )
    return Take(
        "shield_bash",
        [
            Key(0.0, GUARD),
            Key(0.42, coiled),
            Key(0.52, coiled.but(weight=0.55, hips=(-12.0, 6.0, 0.0))),
            Key(0.72, driven),
            Key(0.88, driven.but(shield=(0.48, 0.03, -0.08), weight=0.3)),
            Key(1.50, GUARD.but(weight=0.56)),
            Key(2.1, GUARD),
        ],
        [
            Step(
                "left", 0.48, 0.72, Place(LEFT.x + 0.20, LEFT.y, LEFT.yaw), 0.04, push=6.0, strike=8.0, flat_time=0.06
            ),
            Step("left", 1.08, 1.42, LEFT, 0.04, push=10.0),
        ],
    )


def kick() -> Take:
    """A front kick with the rear leg: knee up, thrust of the sole, knee back, foot home."""
    lifted = GUARD.but(
        height=0.790,
        weight=0.05,
        hips=(-2.0, 0.0, -2.0),
        chest=(-10.0, 2.0, -2.0),
        hand=(0.0, -0.36, -0.26),
        blade=(-10.0, 35.0, 0.0),
        shield=(0.24, 0.30, -0.10),
        face=(40.0, 0.0, 35.0),
    )
    thrust = lifted.but(
        height=0.800,
        hips=(8.0, -14.0, -4.0),
        chest=(-4.0, -8.0, -2.0),
        hand=(-0.08, -0.38, -0.24),
        blade=(-16.0, 45.0, 0.0),
        shield=(0.20, 0.36, -0.08),
        face=(52.0, 0.0, 35.0),
    )
    return Take(
        "kick",
        [
            Key(0.0, GUARD),
            Key(0.45, GUARD.but(weight=0.1, height=0.775, hips=(-10.0, 3.0, 0.0))),
            Key(0.82, lifted),
            Key(1.02, thrust),
            Key(1.12, thrust),
            Key(1.40, lifted.but(weight=0.05)),
            Key(1.95, GUARD.but(weight=0.54, height=0.758)),
            Key(2.5, GUARD),
            Key(2.8, GUARD),
        ],
        [
            Step(
                "right",
                0.52,
                1.82,
                RIGHT,
                via=(
                    (0.68, -0.10, -0.09, 0.20, -16.0, 28.0),
                    (0.84, 0.14, -0.05, 0.44, -2.0, 0.0),
                    (1.06, 0.88, 0.00, 0.62, 0.0, -35.0),
                    (1.13, 0.88, 0.00, 0.61, 0.0, -35.0),
                    (1.34, 0.16, -0.05, 0.38, -4.0, 0.0),
                    (1.58, -0.12, -0.10, 0.12, -28.0, 10.0),
                ),
            ),
        ],
        sway=0.08,
    )


def block_high() -> Take:
    """The shield goes up over the head, takes a blow, and comes back."""
    raised = GUARD.but(
        height=0.735,
        weight=0.58,
        hips=(-16.0, 2.0, 0.0),
        chest=(-20.0, -4.0, 0.0),
        gaze=(0.0, 16.0),
        hand=(-0.02, -0.36, -0.34),
        blade=(-20.0, 8.0, 0.0),
        shield=(0.33, 0.02, 0.20),
        face=(4.0, 40.0, 20.0),
    )
    struck = raised.but(
        height=0.700,
        weight=0.64,
        chest=(-20.0, 2.0, 0.0),
        shield=(0.31, 0.03, 0.165),
        face=(4.0, 44.0, 20.0),
    )
    return Take(
        "block_high",
        [
            Key(0.0, GUARD),
            Key(0.40, raised),
            Key(0.70, raised.but(shield=(0.33, 0.02, 0.205))),
            Key(0.88, struck),
            Key(1.20, raised),
            Key(1.45, raised.but(height=0.74)),
            Key(2.05, GUARD.but(weight=0.46)),
            Key(2.5, GUARD),
        ],
    )


SKILLS: tuple[Callable[[], Take], ...] = (
    guard,
    idle,
    walk_forward,
    step_back,
    turn_left_90,
    turn_right_90,
    slash_down,
    slash_left,
    slash_right,
    stab,
    shield_bash,
    kick,
    block_high,
)
