"""What the body does without a weapon."""

from murmillo.envs.motion.authored.feet import Step
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
