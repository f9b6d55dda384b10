"""Walks and steps, ahead, back and aside."""

from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.gait import (
    DOUBLE_SUPPORT,
    WALKING,
    Carriage,
    Footfall,
    Swing,
    keys_between,
    steps_between,
)
from murmillo.envs.motion.authored.skills.footwork import ahead
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.skills.strides import CARRIED, SETTLING, home, settled, straight
from murmillo.envs.motion.authored.take import STANCE, Key, Take


def walk_forward() -> Take:
    """Eight steps at about 1.3 m/s, the arms steadied by sword and shield."""
    lengths = [0.42, 0.60, *[0.65] * 5, 0.52]
    falls = straight(lengths, first=1.0, beat=0.5, swing=WALKING, flight=-DOUBLE_SUPPORT)
    falls += home(falls[-1], beat=0.5, swing=SETTLING)
    keys = [
        Key(0.0, GUARD),
        Key(0.35, GUARD.but(weight=0.4, height=0.778)),
        *keys_between(Carriage(CARRIED), falls[:-2]),
    ]
    return Take("walk_forward", keys + settled(falls[-1].time), steps_between(falls, 0.54), sway=0.15)


def walk_backward() -> Take:
    """Eight steps of retreat at about 0.9 m/s, toes first, the eyes ahead over the shield."""
    wary = GUARD.but(height=0.782, hips=(-8.0, 5.0, 0.0), chest=(-18.0, 6.0, 0.0), shield=(0.32, 0.11, -0.17))
    toes_first = Swing(lift=0.05, push=8.0, push_time=0.12, strike=-12.0, flat_time=0.14)
    lengths = [-0.20, -0.36, *[-0.46] * 5, -0.40]
    falls = straight(lengths, first=0.95, beat=0.52, swing=toes_first, flight=-0.13)
    falls += home(falls[-1], beat=0.52, swing=toes_first)
    carriage = Carriage(wary, rise=0.02, turn=4.0, counter=4.0, hand=0.03, ahead=-1.0)
    keys = [Key(0.0, GUARD), Key(0.3, GUARD.but(weight=0.36, height=0.76)), *keys_between(carriage, falls[:-2])]
    return Take("walk_backward", keys + settled(falls[-1].time), steps_between(falls, 0.5), sway=0.12)


def walk_left() -> Take:
    """Sidesteps to the left in guard, the left foot opening, the right one closing."""
    return _sidestep("walk_left", 1.0)


def walk_right() -> Take:
    """Sidesteps to the right in guard, the right foot opening, the left one closing."""
    return _sidestep("walk_right", -1.0)


def crouch_walk() -> Take:
    """Creeps forward with deep knees behind the shield at about 0.7 m/s, the sword held back."""
    low = GUARD.but(
        height=0.600,
        hips=(-10.0, 16.0, 0.0),
        chest=(-20.0, 30.0, 0.0),
        gaze=(0.0, 4.0),
        hand=(0.02, -0.34, -0.26),
        blade=(-4.0, 20.0, 0.0),
        shield=(0.38, 0.08, -0.16),
        face=(10.0, 8.0, 32.0),
    )
    creeping = Swing(lift=0.07, push=26.0, push_time=0.20, strike=8.0, flat_time=0.12)
    lengths = [0.30, *[0.42] * 4, 0.36]
    falls = straight(lengths, first=1.25, beat=0.57, swing=creeping, flight=-0.16, width=0.10)
    falls += home(falls[-1], beat=0.57, swing=SETTLING)
    carriage = Carriage(low, rise=0.012, turn=6.0, counter=6.0, drop=2.0, hand=0.03)
    keys = [Key(0.0, GUARD), Key(0.75, low.but(weight=0.40)), *keys_between(carriage, falls[:-2])]
    return Take("crouch_walk", keys + settled(falls[-1].time), steps_between(falls, 0.80), sway=0.12)


def step_back() -> Take:
    """Two guarded steps of retreat, the rear foot first, the shield never dropping."""
    keys, steps, time = [Key(0.0, GUARD), Key(0.3, GUARD.but(weight=0.40, height=0.755))], [], 0.35
    low = GUARD.but(height=0.750, chest=(-26.0, 9.0, 0.0), shield=(0.35, 0.08, -0.15))
    for count in (1, 2):
        back = -0.34 * count
        steps += [
            Step("right", time, time + 0.34, Place(RIGHT.x + back, RIGHT.y, RIGHT.yaw), 0.045, push=8.0),
            Step("left", time + 0.46, time + 0.80, Place(LEFT.x + back, LEFT.y, LEFT.yaw), 0.045, push=10.0),
        ]
        keys += [Key(time + 0.36, low.but(weight=0.55)), Key(time + 0.80, low.but(height=0.765, weight=0.55))]
        time += 1.05
    keys += [Key(time + 0.35, GUARD.but(weight=0.46, height=0.762)), Key(time + 0.7, GUARD)]
    return Take("step_back", keys, steps)


def _sidestep(label: str, side: float) -> Take:
    opening, closing = ("left", "right") if side > 0.0 else ("right", "left")
    swing = Swing(lift=0.04, push=9.0, push_time=0.14)
    falls, time = [], 0.75
    for count in range(1, 6):
        y = 0.36 * side * count
        falls.append(Footfall(opening, time, ahead(STANCE[opening], 0.0, y), -0.12, swing))
        falls.append(Footfall(closing, time + 0.44, ahead(STANCE[closing], 0.0, y), -0.12, swing))
        time += 0.92
    wide = GUARD.but(
        height=0.735, hips=(-14.0, 5.0, 2.0 * side), chest=(-22.0, 8.0, -2.0 * side), gaze=(6.0 * side, 0.0)
    )
    closed = GUARD.but(
        height=0.768, hips=(-13.0, 4.0, -1.0 * side), chest=(-25.0, 6.0, 1.0 * side), gaze=(6.0 * side, 0.0),
        hand=(0.11, -0.30, -0.275), shield=(0.325, 0.09, -0.16),
    )  # fmt: skip
    ready = GUARD.but(weight=0.5 + 0.16 * side, height=0.755, gaze=(8.0 * side, 0.0))
    keys = [Key(0.0, GUARD), Key(0.35, ready)]
    keys += [Key(fall.time, wide if fall.foot == opening else closed) for fall in falls]
    return Take(label, keys + settled(falls[-1].time), steps_between(falls, 0.42), sway=0.10)
