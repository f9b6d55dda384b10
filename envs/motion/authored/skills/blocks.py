"""Behind the shield: each block raises it into the way of a blow, gives under the blow, holds, and comes back."""

from murmillo.envs.motion.authored.body import Pose
from murmillo.envs.motion.authored.skills.footwork import ahead, recovered, step_home, step_in
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT
from murmillo.envs.motion.authored.take import Key, Take


def block_high() -> Take:
    """Over the head."""
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
        height=0.695,
        weight=0.64,
        chest=(-20.0, 3.0, 0.0),
        shield=(0.315, 0.03, 0.168),
        face=(4.0, 44.0, 20.0),
    )
    return _block("block_high", raised, struck)


def block_low() -> Take:
    """Before the leading knee, the eyes staying up over the rim."""
    lowered = GUARD.but(
        height=0.628,
        weight=0.38,
        hips=(-14.0, 16.0, -2.0),
        chest=(-28.0, 38.0, -6.0),
        hand=(-0.10, -0.38, -0.24),
        blade=(-14.0, 34.0, 0.0),
        shield=(0.30, 0.12, -0.35),
        face=(8.0, -15.0, 10.0),
    )
    struck = lowered.but(
        height=0.634,
        weight=0.42,
        hips=(-15.0, 15.0, -1.0),
        chest=(-31.0, 36.0, -5.0),
        shield=(0.27, 0.12, -0.335),
    )
    return _block("block_low", lowered, struck)


def block_left() -> Take:
    """To the left, the chest turning in behind the shield."""
    across = GUARD.but(
        height=0.745,
        weight=0.40,
        hips=(4.0, 4.0, -2.0),
        chest=(18.0, 6.0, -3.0),
        gaze=(42.0, 0.0),
        hand=(0.04, -0.32, -0.30),
        blade=(-12.0, 38.0, 0.0),
        shield=(0.24, 0.34, -0.02),
        face=(72.0, 0.0, 55.0),
    )
    struck = across.but(
        height=0.725,
        weight=0.54,
        hips=(0.0, 4.0, 2.0),
        chest=(10.0, 6.0, 3.0),
        shield=(0.23, 0.28, -0.03),
        face=(66.0, 2.0, 55.0),
    )
    return _block("block_left", across, struck)


def block_right() -> Take:
    """Across to the right, the shoulder turned in behind the shield and the sword out of its way."""
    across = GUARD.but(
        height=0.745,
        weight=0.58,
        hips=(-36.0, 4.0, 2.0),
        chest=(-68.0, 7.0, 3.0),
        gaze=(-40.0, 0.0),
        hand=(-0.22, -0.34, -0.34),
        blade=(-60.0, 20.0, 0.0),
        shield=(0.29, -0.22, -0.10),
        face=(-62.0, -14.0, 45.0),
    )
    struck = across.but(
        height=0.725,
        weight=0.46,
        hips=(-31.0, 4.0, -1.0),
        chest=(-61.0, 7.0, -2.0),
        shield=(0.26, -0.16, -0.11),
        face=(-55.0, -12.0, 45.0),
    )
    return _block("block_right", across, struck)


def block_crouched() -> Take:
    """Steps wide, sinks behind the shield with the eyes at its rim, takes the blow and rises."""
    sunk = GUARD.but(
        height=0.545,
        weight=0.50,
        hips=(-16.0, 16.0, 0.0),
        chest=(-24.0, 26.0, 0.0),
        gaze=(0.0, 4.0),
        hand=(0.02, -0.34, -0.26),
        blade=(-8.0, 32.0, 0.0),
        shield=(0.35, 0.05, -0.06),
        face=(6.0, 10.0, 40.0),
    )
    struck = sunk.but(
        height=0.515,
        weight=0.60,
        chest=(-26.0, 28.0, 1.0),
        shield=(0.30, 0.05, -0.08),
        face=(6.0, 14.0, 40.0),
    )
    return Take(
        "block_crouched",
        [
            Key(0.0, GUARD),
            Key(0.30, GUARD.but(weight=0.60, height=0.755)),
            Key(0.80, sunk),
            Key(1.15, sunk.but(height=0.550)),
            Key(1.30, struck),
            Key(1.62, sunk),
            Key(1.90, sunk.but(height=0.565, weight=0.56)),
            Key(2.60, recovered(0.46)),
            Key(3.1, GUARD),
        ],
        [
            step_in(0.36, 0.66, ahead(LEFT, 0.14, 0.03, 6.0)),
            step_home(2.02, 2.36),
        ],
    )


def _block(label: str, ready: Pose, struck: Pose) -> Take:
    """In the way of the blow by 0.46 s; it falls at 0.88 s, and the knees and the trunk take it."""
    return Take(
        label,
        [
            Key(0.0, GUARD),
            Key(0.46, ready),
            Key(0.74, ready.but(height=ready.height + 0.004)),
            Key(0.88, struck),
            Key(1.20, ready),
            Key(1.50, ready.but(height=ready.height + 0.006)),
            Key(2.10, recovered(0.47)),
            Key(2.6, GUARD),
        ],
    )
