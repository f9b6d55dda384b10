"""Blows that flow into each other: what is left of one swing winds up the next, and the feet advance under them."""

from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.skills.footwork import ahead, recovered, step_in
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.skills.strokes import DOWN, DOWN_RIGHT, LEFTWARD, RIGHTWARD, UP_LEFT
from murmillo.envs.motion.authored.take import Key, Take


def combo_diagonal() -> Take:
    """Down to the right, then back up to the left along the same line."""
    return Take(
        "combo_diagonal",
        [
            Key(0.0, GUARD),
            *DOWN_RIGHT.flowing(0.50),
            *UP_LEFT.keys(1.20),
            Key(2.60, recovered(0.54)),
            Key(3.2, GUARD),
        ],
        [
            step_in(0.52, 0.78, ahead(LEFT, 0.16)),
            Step("right", 0.92, 1.20, ahead(RIGHT, 0.20), 0.035, push=12.0),
            step_in(1.26, 1.52, ahead(LEFT, 0.30)),
            Step("right", 2.04, 2.36, ahead(RIGHT, 0.30), 0.035, push=14.0),
        ],
    )


def combo_cross() -> Take:
    """Left, back to the right, then down through the middle, three steps deep."""
    return Take(
        "combo_cross",
        [
            Key(0.0, GUARD),
            *LEFTWARD.flowing(0.46),
            *RIGHTWARD.flowing(1.20),
            *DOWN.keys(2.10),
            Key(3.40, recovered(0.54)),
            Key(4.0, GUARD),
        ],
        [
            step_in(0.50, 0.74, ahead(LEFT, 0.14)),
            Step("right", 0.96, 1.26, ahead(RIGHT, 0.16), 0.035, push=12.0),
            step_in(1.30, 1.54, ahead(LEFT, 0.22)),
            Step("right", 1.74, 2.04, ahead(RIGHT, 0.26), 0.035, push=12.0),
            step_in(2.14, 2.38, ahead(LEFT, 0.40)),
            Step("right", 2.84, 3.16, ahead(RIGHT, 0.40), 0.035, push=14.0),
        ],
    )


def spin_attack() -> Take:
    """A full turn to the left, stepping round in front of the enemy, the blade trailing, then whipped across."""
    coiled = LEFTWARD.wound.but(height=0.745, weight=0.42, hips=(-30.0, 5.0, 0.0), chest=(-56.0, 6.0, 2.0))
    trailing = GUARD.but(
        height=0.785,
        hips=(0.0, 5.0, 0.0),
        chest=(-14.0, 8.0, 0.0),
        gaze=(50.0, 0.0),
        hand=(-0.10, -0.50, -0.14),
        blade=(-100.0, 12.0, 75.0),
        shield=(0.28, 0.16, -0.12),
        face=(24.0, 0.0, 32.0),
    )
    across = LEFTWARD.midway.but(gaze=(0.0, 0.0), weight=0.45)
    return Take(
        "spin_attack",
        [
            Key(0.0, GUARD),
            Key(0.44, coiled),
            Key(0.66, trailing.but(weight=0.30, gaze=(-20.0, 0.0)), 40.0),
            Key(0.92, trailing.but(gaze=(30.0, 0.0)), 124.0),
            Key(1.22, trailing.but(gaze=(45.0, 0.0)), 255.0),
            Key(1.42, trailing.but(gaze=(30.0, 0.0), weight=0.5), 318.0),
            Key(1.58, across, 350.0),
            Key(1.72, LEFTWARD.through, 360.0),
            Key(1.92, LEFTWARD.spent.but(weight=0.44), 360.0),
            Key(2.66, recovered(0.52), 360.0),
            Key(3.2, GUARD, 360.0),
        ],
        [
            Step("left", 0.28, 0.52, Place(0.24, 0.14, 95.0), 0.03, push=6.0),
            Step(
                "right",
                0.54,
                0.92,
                Place(0.58, 0.33, 162.0),
                via=(
                    (0.60, -0.18, -0.14, 0.045, -30.0, 20.0),
                    (0.66, -0.03, -0.15, 0.065, -5.0, 14.0),
                    (0.73, 0.22, -0.12, 0.08, 45.0, 6.0),
                    (0.82, 0.48, 0.04, 0.06, 105.0, 0.0),
                    (0.88, 0.57, 0.24, 0.025, 145.0, 0.0),
                ),
            ),
            Step(
                "left",
                0.94,
                1.24,
                Place(0.86, 0.04, 310.0),
                via=(
                    (1.02, 0.34, 0.03, 0.05, 150.0, 10.0),
                    (1.11, 0.60, -0.02, 0.06, 225.0, 4.0),
                    (1.19, 0.81, 0.03, 0.025, 290.0, 0.0),
                ),
            ),
            Step("right", 1.26, 1.54, Place(0.44, -0.20, 322.0), 0.04, push=8.0),
            Step("left", 2.00, 2.26, Place(0.86, 0.04, 364.0), 0.03, push=8.0),
        ],
    )
