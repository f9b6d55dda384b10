"""How it stands: in guard, at ease, on the alert."""

from murmillo.envs.motion.authored.feet import Step
from murmillo.envs.motion.authored.skills.footwork import ahead
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.take import Key, Take


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


def idle_relaxed() -> Take:
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
        "idle_relaxed",
        [
            Key(0.0, GUARD),
            Key(1.0, ease),
            Key(1.9, breath.but(gaze=(24.0, 0.0), weight=0.52)),
            Key(2.9, ease.but(gaze=(-8.0, 0.0), weight=0.44, hips=(-12.0, 1.0, -1.5))),
            Key(3.7, breath.but(gaze=(-20.0, 0.0), weight=0.5)),
            Key(4.9, GUARD),
        ],
    )


def idle_alert() -> Take:
    """Crouched and restless: the eyes, then the chest and the shield go left and right, the feet shift under it."""
    low = GUARD.but(
        height=0.728,
        hips=(-12.0, 8.0, 0.0),
        chest=(-22.0, 13.0, 0.0),
        hand=(0.06, -0.33, -0.24),
        blade=(2.0, 40.0, 0.0),
        shield=(0.34, 0.08, -0.12),
        face=(10.0, 2.0, 34.0),
    )
    left = low.but(
        weight=0.40,
        hips=(-4.0, 8.0, -1.5),
        chest=(-4.0, 12.0, -2.0),
        gaze=(38.0, 0.0),
        shield=(0.30, 0.20, -0.11),
        face=(36.0, 2.0, 36.0),
    )
    right = low.but(
        weight=0.60,
        hips=(-22.0, 8.0, 1.5),
        chest=(-42.0, 12.0, 2.0),
        gaze=(-38.0, 0.0),
        hand=(-0.02, -0.38, -0.22),
        blade=(-22.0, 44.0, 0.0),
        shield=(0.35, -0.02, -0.10),
        face=(-8.0, 2.0, 36.0),
    )
    return Take(
        "idle_alert",
        [
            Key(0.0, GUARD),
            Key(0.60, low.but(weight=0.56)),
            Key(0.90, low.but(gaze=(30.0, 0.0), weight=0.52)),
            Key(1.35, left),
            Key(1.75, left.but(height=0.735, gaze=(30.0, 2.0))),
            Key(2.15, low.but(height=0.735, gaze=(-20.0, 0.0), weight=0.48)),
            Key(2.60, right),
            Key(3.05, right.but(height=0.735, gaze=(-30.0, 2.0))),
            Key(3.50, low.but(weight=0.5)),
            Key(4.20, GUARD.but(height=0.762, weight=0.47)),
            Key(4.7, GUARD),
        ],
        [
            Step("right", 0.28, 0.56, ahead(RIGHT, -0.06, -0.03), 0.03, push=8.0),
            Step("left", 1.86, 2.12, ahead(LEFT, 0.03, 0.02), 0.03, push=6.0),
            Step("right", 3.40, 3.68, RIGHT, 0.03, push=8.0),
            Step("left", 3.84, 4.10, LEFT, 0.03, push=6.0),
        ],
    )
