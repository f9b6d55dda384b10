"""What the shield does: blows with it and blocks behind it."""

from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT
from murmillo.envs.motion.authored.take import Key, Take


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
