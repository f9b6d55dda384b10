"""Out of the way and through: jumps, dodges and the charge behind the shield."""

from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.gait import Footfall, Swing, steps_between
from murmillo.envs.motion.authored.skills.footwork import ahead
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.take import STANCE, Key, Take

CROUCHED = GUARD.but(
    height=0.640,
    hips=(-14.0, 22.0, 0.0),
    chest=(-22.0, 34.0, 0.0),
    gaze=(0.0, 2.0),
    hand=(-0.04, -0.33, -0.34),
    blade=(-6.0, 8.0, 0.0),
    shield=(0.28, 0.14, -0.26),
    face=(24.0, 0.0, 25.0),
)


def jump() -> Take:
    """Crouches, leaps forward with both legs, tucks them, lands softly and rises: 0.4 s in the air."""
    leap, leaves, lands = 0.26, 0.90, 1.30
    launched = GUARD.but(
        height=0.860,
        hips=(-12.0, 4.0, 0.0),
        chest=(-20.0, 6.0, 0.0),
        hand=(0.14, -0.32, -0.16),
        blade=(-4.0, 50.0, 0.0),
        shield=(0.36, 0.10, -0.06),
        face=(12.0, 6.0, 32.0),
    )
    flown = launched.but(
        hips=(-12.0, 8.0, 0.0),
        chest=(-20.0, 13.0, 0.0),
        hand=(0.12, -0.33, -0.20),
        blade=(-4.0, 38.0, 0.0),
        shield=(0.36, 0.12, -0.12),
    )
    return Take(
        "jump",
        [
            Key(0.0, GUARD),
            Key(0.60, CROUCHED),
            Key(0.68, CROUCHED),
            Key(leaves, launched),
            Key(0.5 * (leaves + lands), flown.but(height=0.90)),
            Key(lands, flown.but(height=0.785)),
            Key(lands + 0.26, CROUCHED.but(height=0.650, hips=(-14.0, 18.0, 0.0), chest=(-22.0, 28.0, 0.0))),
            Key(lands + 0.80, GUARD.but(height=0.772, weight=0.47)),
            Key(lands + 1.20, GUARD),
        ],
        [
            Step(
                foot, leaves, lands, ahead(STANCE[foot], leap), lift=0.22, push=38.0, push_time=0.16, strike=-14.0,
                flat_time=0.08,
            )
            for foot in ("left", "right")
        ],
    )  # fmt: skip


def dodge_left() -> Take:
    """A low hop to the left off the right leg, the head out of the line, and back into guard."""
    return _dodge("dodge_left", 1.0)


def dodge_right() -> Take:
    """A low hop to the right off the left leg, the head out of the line, and back into guard."""
    return _dodge("dodge_right", -1.0)


def dodge_back() -> Take:
    """Springs back off the leading leg, low behind the shield, lands on the rear foot and takes guard again."""
    back, leaves, lands = -0.50, 0.70, 0.8333
    coiled = GUARD.but(height=0.690, weight=0.42, hips=(-12.0, 12.0, 0.0), chest=(-20.0, 18.0, 0.0))
    away = GUARD.but(
        height=0.700,
        weight=0.60,
        hips=(-18.0, 10.0, 0.0),
        chest=(-30.0, 16.0, 0.0),
        hand=(0.02, -0.32, -0.28),
        shield=(0.40, 0.06, -0.12),
        face=(6.0, 4.0, 34.0),
    )
    return Take(
        "dodge_back",
        [
            Key(0.0, GUARD),
            Key(0.42, coiled),
            Key(0.76, away),
            Key(1.10, away.but(height=0.640, weight=0.62, chest=(-28.0, 24.0, 0.0), hips=(-16.0, 16.0, 0.0))),
            Key(1.75, GUARD.but(height=0.760, weight=0.52)),
            Key(2.20, GUARD),
        ],
        [
            Step("right", 0.50, lands, ahead(RIGHT, back), 0.06, push=8.0, push_time=0.12, strike=-14.0),
            Step("left", leaves, lands + 0.27, ahead(LEFT, back), 0.07, push=30.0, push_time=0.18, strike=-10.0),
        ],
    )


def shield_charge() -> Take:
    """Three driving steps low behind the shield and the ram at the end of the third."""
    braced = GUARD.but(
        height=0.700,
        hips=(-12.0, 14.0, 0.0),
        chest=(-34.0, 22.0, 0.0),
        gaze=(0.0, 3.0),
        hand=(-0.06, -0.34, -0.28),
        blade=(-8.0, 32.0, 0.0),
        shield=(0.32, 0.06, -0.10),
        face=(6.0, 2.0, 44.0),
    )
    rammed = braced.but(
        height=0.695,
        weight=0.22,
        hips=(-26.0, 14.0, 0.0),
        chest=(-48.0, 20.0, 0.0),
        hand=(-0.12, -0.36, -0.25),
        shield=(0.50, 0.02, -0.03),
        face=(2.0, 6.0, 50.0),
    )
    driving = Swing(lift=0.06, push=34.0, push_time=0.16, strike=4.0, flat_time=0.06)
    falls = [
        Footfall("left", 0.80, Place(0.52, 0.10, 4.0), -0.08, driving),
        Footfall("right", 1.18, Place(1.06, -0.10, -12.0), 0.0, driving),
        Footfall("left", 1.56, Place(1.74, 0.10, 4.0), 0.0, driving),
        Footfall("right", 2.10, ahead(RIGHT, 1.74 - LEFT.x), -0.24, Swing(lift=0.05, push=34.0, push_time=0.18)),
    ]
    home = Place(1.74, LEFT.y, LEFT.yaw)
    return Take(
        "shield_charge",
        [
            Key(0.0, GUARD),
            Key(0.42, braced.but(weight=0.62, height=0.715)),
            Key(0.80, braced.but(hips=(-18.0, 14.0, 0.0))),
            Key(1.18, braced.but(hips=(-4.0, 15.0, 0.0), shield=(0.30, 0.06, -0.11))),
            Key(1.42, braced.but(hips=(-10.0, 14.0, 0.0), shield=(0.29, 0.07, -0.12))),
            Key(1.58, rammed),
            Key(1.74, rammed.but(shield=(0.47, 0.02, -0.05), weight=0.28)),
            Key(2.20, GUARD.but(height=0.745, weight=0.46)),
            Key(2.85, GUARD),
        ],
        [*steps_between(falls, 0.46), Step("left", 2.30, 2.56, home, 0.025, push=6.0)],
    )


def _dodge(label: str, side: float) -> Take:
    pushing, landing = ("right", "left") if side > 0.0 else ("left", "right")
    aside, leaves, lands = 0.62 * side, 0.70, 0.8333
    coiled = GUARD.but(
        height=0.680,
        weight=0.5 + 0.20 * side,
        hips=(-14.0, 12.0, 4.0 * side),
        chest=(-22.0, 18.0, 6.0 * side),
    )
    away = GUARD.but(
        height=0.680,
        weight=0.5 - 0.3 * side,
        hips=(-14.0, 12.0, -8.0 * side),
        chest=(-22.0 - 6.0 * side, 20.0, -16.0 * side),
        gaze=(-6.0 * side, 0.0),
        hand=(0.06, -0.34, -0.24),
        shield=(0.34, 0.12, -0.12),
        face=(10.0 - 8.0 * side, 0.0, 34.0),
    )
    return Take(
        label,
        [
            Key(0.0, GUARD),
            Key(0.42, coiled),
            Key(leaves, away),
            Key(lands + 0.24, away.but(height=0.625, weight=0.5 - 0.22 * side, hips=(-14.0, 16.0, -4.0 * side))),
            Key(1.65, GUARD.but(height=0.758, weight=0.5 - 0.05 * side)),
            Key(2.10, GUARD),
        ],
        [
            Step(landing, 0.50, lands, ahead(STANCE[landing], 0.0, aside), 0.06, push=10.0, strike=-8.0),
            Step(
                pushing, leaves, lands + 0.26, ahead(STANCE[pushing], 0.0, aside), 0.07, push=28.0, push_time=0.16,
                strike=-8.0,
            ),
        ],
    )  # fmt: skip
