"""Blows with the shield."""

from murmillo.envs.motion.authored.skills.footwork import ahead, recovered, step_home, step_in
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT
from murmillo.envs.motion.authored.take import Key, Take


def shield_bash() -> Take:
    """Coils behind the shield and drives it forward with the leading leg."""
    coiled = GUARD.but(
        height=0.735,
        weight=0.70,
        hips=(-4.0, 6.0, 1.0),
        chest=(-4.0, 9.0, 2.0),
        hand=(0.12, -0.30, -0.28),
        blade=(0.0, 34.0, 0.0),
        shield=(0.22, 0.12, -0.14),
        face=(6.0, -6.0, 42.0),
    )
    driven = GUARD.but(
        height=0.74,
        weight=0.24,
        hips=(-26.0, 8.0, 0.0),
        chest=(-46.0, 12.0, 0.0),
        hand=(-0.10, -0.36, -0.27),
        blade=(-10.0, 30.0, 0.0),
        shield=(0.50, 0.06, -0.07),
        face=(4.0, 4.0, 48.0),
    )
    return Take(
        "shield_bash",
        [
            Key(0.0, GUARD),
            Key(0.42, coiled),
            Key(0.52, coiled.but(weight=0.55, hips=(-8.0, 6.0, 0.0))),
            Key(0.72, driven),
            Key(0.88, driven.but(shield=(0.48, 0.06, -0.09), weight=0.3)),
            Key(1.50, recovered(0.56)),
            Key(2.1, GUARD),
        ],
        [step_in(0.48, 0.72, ahead(LEFT, 0.20)), step_home(1.08, 1.42)],
    )


def swipe() -> Take:
    """Coiled to the right, then the shield backhanded to the left, its rim leading."""
    coiled = GUARD.but(
        height=0.742,
        weight=0.64,
        hips=(-28.0, 5.0, 2.0),
        chest=(-58.0, 8.0, 3.0),
        hand=(-0.16, -0.36, -0.32),
        blade=(-40.0, 22.0, 0.0),
        shield=(0.30, -0.10, -0.16),
        face=(-20.0, 40.0, 0.0),
    )
    loosed = coiled.but(weight=0.50, hips=(-16.0, 5.0, 1.0), chest=(-46.0, 8.0, 2.0), shield=(0.34, -0.06, -0.13))
    level = GUARD.but(
        height=0.745,
        weight=0.32,
        hips=(4.0, 6.0, 0.0),
        chest=(6.0, 9.0, -1.0),
        hand=(0.02, -0.36, -0.32),
        blade=(-24.0, 24.0, 0.0),
        shield=(0.44, 0.16, -0.06),
        face=(70.0, 50.0, 0.0),
    )
    past = level.but(
        weight=0.30,
        hips=(10.0, 5.0, -1.0),
        chest=(28.0, 7.0, -3.0),
        shield=(0.22, 0.42, -0.06),
        face=(112.0, 36.0, 0.0),
    )
    return Take(
        "swipe",
        [
            Key(0.0, GUARD),
            Key(0.48, coiled),
            Key(0.58, loosed),
            Key(0.76, level),
            Key(0.90, past),
            Key(1.08, past.but(chest=(32.0, 7.0, -3.0), face=(118.0, 32.0, 0.0), weight=0.36)),
            Key(1.80, recovered(0.54)),
            Key(2.4, GUARD),
        ],
        [step_in(0.52, 0.76, ahead(LEFT, 0.12, 0.03, 6.0)), step_home(1.28, 1.60)],
    )
