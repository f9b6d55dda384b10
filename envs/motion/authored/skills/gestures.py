"""What it tells the enemy: a taunt and a roar."""

from murmillo.envs.motion.authored.feet import Step
from murmillo.envs.motion.authored.skills.footwork import ahead, recovered, step_home
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT
from murmillo.envs.motion.authored.take import Key, Take


def taunt() -> Take:
    """Beats the flat of the blade on the shield twice, then opens both arms: come on."""
    presented = GUARD.but(
        height=0.775,
        weight=0.56,
        hips=(-10.0, 2.0, 0.0),
        chest=(-14.0, 2.0, 0.0),
        shield=(0.33, 0.10, -0.12),
        face=(0.0, -12.0, 35.0),
        hand=(0.34, -0.36, -0.10),
        blade=(36.0, 36.0, -20.0),
    )
    struck = presented.but(
        chest=(-8.0, 4.0, -1.0),
        weight=0.52,
        hand=(0.372, -0.305, -0.128),
        blade=(80.0, 5.0, -20.0),
    )
    swung = presented.but(hand=(0.36, -0.37, -0.09), blade=(22.0, 34.0, -20.0))
    opened = GUARD.but(
        height=0.800,
        weight=0.60,
        hips=(-10.0, -2.0, 1.0),
        chest=(-8.0, -6.0, 2.0),
        gaze=(0.0, 10.0),
        hand=(0.14, -0.56, -0.18),
        blade=(-40.0, 40.0, 30.0),
        shield=(0.14, 0.50, -0.16),
        face=(78.0, 10.0, 20.0),
    )
    nod = opened.but(gaze=(0.0, -2.0), hand=(0.20, -0.54, -0.10), blade=(-20.0, 66.0, 30.0), weight=0.55)
    return Take(
        "taunt",
        [
            Key(0.0, GUARD),
            Key(0.50, presented),
            Key(0.66, struck),
            Key(0.90, swung),
            Key(1.08, struck),
            Key(1.36, swung.but(height=0.780)),
            Key(2.05, opened),
            Key(2.40, nod),
            Key(2.72, opened.but(weight=0.56)),
            Key(3.02, nod.but(weight=0.52)),
            Key(3.40, opened.but(weight=0.50, chest=(-8.0, -4.0, 0.0))),
            Key(4.20, recovered(0.47)),
            Key(4.7, GUARD),
        ],
    )


def roar() -> Take:
    """Gathers itself over the weapons, bursts up with arms wide, chest out and head back, and shakes with it."""
    gathered = GUARD.but(
        height=0.675,
        weight=0.55,
        hips=(-14.0, 14.0, 0.0),
        chest=(-20.0, 34.0, 0.0),
        gaze=(0.0, -24.0),
        hand=(0.24, -0.22, -0.26),
        blade=(20.0, 48.0, 0.0),
        shield=(0.28, 0.14, -0.22),
        face=(24.0, 0.0, 20.0),
    )
    burst = GUARD.but(
        height=0.812,
        weight=0.48,
        hips=(-10.0, -6.0, 0.0),
        chest=(-8.0, -18.0, 0.0),
        gaze=(0.0, 26.0),
        hand=(0.00, -0.62, 0.06),
        blade=(-60.0, 52.0, 20.0),
        shield=(0.06, 0.52, -0.02),
        face=(66.0, 10.0, 25.0),
    )
    left = burst.but(chest=(-2.0, -19.0, -3.0), gaze=(10.0, 28.0), weight=0.44, hand=(0.01, -0.62, 0.10))
    right = burst.but(chest=(-14.0, -19.0, 3.0), gaze=(-10.0, 28.0), weight=0.52, hand=(0.0, -0.62, 0.03))
    return Take(
        "roar",
        [
            Key(0.0, GUARD),
            Key(0.72, gathered),
            Key(0.86, gathered.but(height=0.670)),
            Key(1.22, burst),
            Key(1.52, left),
            Key(1.84, right),
            Key(2.14, left.but(height=0.808)),
            Key(2.50, burst.but(height=0.808, gaze=(0.0, 20.0))),
            Key(3.40, recovered(0.47)),
            Key(4.0, GUARD),
        ],
        [
            Step("left", 0.94, 1.22, ahead(LEFT, 0.08, 0.08, 10.0), 0.04, push=8.0),
            step_home(2.74, 3.06),
        ],
    )
