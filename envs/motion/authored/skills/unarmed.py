"""What the body does without a weapon."""

from murmillo.envs.motion.authored.feet import Step
from murmillo.envs.motion.authored.skills.footwork import recovered
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, RIGHT
from murmillo.envs.motion.authored.take import Key, Take


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
    gathered = GUARD.but(
        height=0.742,
        weight=0.18,
        hips=(-18.0, 6.0, -1.0),
        chest=(-30.0, 9.0, -1.0),
        hand=(0.14, -0.29, -0.27),
        shield=(0.34, 0.08, -0.14),
    )
    return Take(
        "kick",
        [
            Key(0.0, GUARD),
            Key(0.40, gathered),
            Key(0.84, lifted),
            Key(1.04, thrust),
            Key(1.15, thrust),
            Key(1.46, lifted.but(weight=0.05)),
            Key(2.02, recovered(0.54)),
            Key(2.6, GUARD),
        ],
        [
            Step(
                "right",
                0.50,
                1.88,
                RIGHT,
                via=(
                    (0.66, -0.12, -0.09, 0.17, -18.0, 28.0),
                    (0.84, 0.12, -0.05, 0.44, -2.0, 4.0),
                    (1.06, 0.88, 0.00, 0.62, 0.0, -28.0),
                    (1.15, 0.88, 0.00, 0.61, 0.0, -28.0),
                    (1.40, 0.16, -0.05, 0.38, -4.0, 0.0),
                    (1.66, -0.14, -0.10, 0.10, -30.0, 8.0),
                ),
            ),
        ],
        sway=0.08,
    )
