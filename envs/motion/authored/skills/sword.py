"""What the sword does in one blow: slashes, a thrust, a parry; each with anticipation, strike and recovery."""

from murmillo.envs.motion.authored.skills.footwork import ahead, recovered, step_home, step_in
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT
from murmillo.envs.motion.authored.skills.strokes import DOWN, LEFTWARD, RIGHTWARD, UP
from murmillo.envs.motion.authored.take import Key, Take

# The end of a lunge, the blade level and the shoulder behind it.
THRUST = GUARD.but(
    height=0.715,
    weight=0.26,
    hips=(4.0, 7.0, 0.0),
    chest=(22.0, 10.0, 0.0),
    hand=(0.58, -0.10, -0.12),
    blade=(1.0, 4.0, 25.0),
    shield=(0.16, 0.30, -0.22),
    face=(50.0, 0.0, 28.0),
)


def slash_down() -> Take:
    """From over the right shoulder down through the middle, with a short step of the leading foot."""
    return Take(
        "slash_down",
        [Key(0.0, GUARD), *DOWN.keys(0.46), Key(1.65, recovered(0.56)), Key(2.2, GUARD)],
        [step_in(0.50, 0.74, ahead(LEFT, 0.14)), step_home(1.20, 1.52)],
    )


def slash_up() -> Take:
    """From beside the right knee up past the face, the legs straightening under it."""
    return Take(
        "slash_up",
        [Key(0.0, GUARD), *UP.keys(0.50), Key(1.90, recovered(0.56)), Key(2.5, GUARD)],
        [step_in(0.56, 0.82, ahead(LEFT, 0.12)), step_home(1.36, 1.68)],
    )


def slash_left() -> Take:
    """A level cut from the right to the left, the edge leading, the shield drawn away as a counterweight."""
    return Take(
        "slash_left",
        [Key(0.0, GUARD), *LEFTWARD.keys(0.48), Key(1.75, recovered(0.54)), Key(2.3, GUARD)],
        [step_in(0.52, 0.76, ahead(LEFT, 0.10, 0.03, 6.0)), step_home(1.25, 1.58)],
    )


def slash_right() -> Take:
    """The backhand: coiled over the shield arm, then level from the left to the right."""
    return Take(
        "slash_right",
        [Key(0.0, GUARD), *RIGHTWARD.keys(0.50), Key(1.75, recovered(0.48)), Key(2.3, GUARD)],
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
    loosed = drawn.but(weight=0.5, hips=(-14.0, 4.0, 0.0), chest=(-34.0, 5.0, 0.0), hand=(-0.08, -0.33, -0.26))
    return Take(
        "stab",
        [
            Key(0.0, GUARD),
            Key(0.42, drawn),
            Key(0.52, loosed),
            Key(0.72, THRUST),
            Key(0.86, THRUST.but(hand=(0.56, -0.10, -0.13), weight=0.3)),
            Key(1.45, recovered(0.56)),
            Key(2.0, GUARD),
        ],
        [step_in(0.46, 0.72, ahead(LEFT, 0.24)), step_home(1.02, 1.36)],
        whip=0.0,
    )


def parry() -> Take:
    """Beats a blade aside to the left with the flat, turns the point in behind it and thrusts."""
    cocked = GUARD.but(
        height=0.772,
        weight=0.60,
        hips=(-20.0, 3.0, 0.0),
        chest=(-36.0, 4.0, 0.0),
        hand=(0.20, -0.36, -0.16),
        blade=(-12.0, 58.0, 20.0),
        shield=(0.28, 0.16, -0.18),
        face=(24.0, 0.0, 30.0),
    )
    beat = cocked.but(
        height=0.752,
        weight=0.52,
        hips=(-6.0, 5.0, 0.0),
        chest=(-4.0, 7.0, 0.0),
        hand=(0.38, -0.04, -0.12),
        blade=(30.0, 52.0, 40.0),
        shield=(0.12, 0.34, -0.22),
        face=(62.0, 0.0, 22.0),
    )
    aimed = beat.but(
        weight=0.56,
        hips=(-14.0, 4.0, 0.0),
        chest=(-20.0, 6.0, 0.0),
        hand=(0.17, -0.17, -0.16),
        blade=(3.0, 8.0, 30.0),
        shield=(0.16, 0.32, -0.20),
        face=(52.0, 0.0, 26.0),
    )
    driven = aimed.but(
        height=0.732,
        weight=0.38,
        hips=(-3.0, 6.0, 0.0),
        chest=(6.0, 8.0, 0.0),
        hand=(0.43, -0.16, -0.13),
        blade=(2.0, 6.0, 28.0),
    )
    return Take(
        "parry",
        [
            Key(0.0, GUARD),
            Key(0.38, cocked),
            Key(0.56, beat),
            Key(0.66, beat.but(blade=(38.0, 48.0, 45.0), chest=(0.0, 7.0, 0.0))),
            Key(0.92, aimed),
            Key(1.06, driven),
            Key(1.19, THRUST.but(face=(58.0, 0.0, 24.0))),
            Key(1.34, THRUST.but(hand=(0.56, -0.10, -0.13), weight=0.3)),
            Key(1.95, recovered(0.56)),
            Key(2.5, GUARD),
        ],
        [step_in(0.92, 1.16, ahead(LEFT, 0.22)), step_home(1.46, 1.80)],
        whip=0.0,
    )
