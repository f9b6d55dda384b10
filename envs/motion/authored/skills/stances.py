"""How it stands: breathing, looking about, at ease."""

from murmillo.envs.motion.authored.skills.guard_pose import GUARD
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


def idle() -> Take:
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
        "idle",
        [
            Key(0.0, GUARD),
            Key(1.0, ease),
            Key(1.9, breath.but(gaze=(24.0, 0.0), weight=0.52)),
            Key(2.9, ease.but(gaze=(-8.0, 0.0), weight=0.44, hips=(-12.0, 1.0, -1.5))),
            Key(3.7, breath.but(gaze=(-20.0, 0.0), weight=0.5)),
            Key(4.9, GUARD),
        ],
    )
