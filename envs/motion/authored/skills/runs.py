"""Runs, ahead, back and aside, each from guard and back into it."""

from dataclasses import replace

import numpy as np

from murmillo.envs.motion.authored.gait import RUNNING, Carriage, Footfall, Swing, keys_between, steps_between
from murmillo.envs.motion.authored.skills.footwork import ahead
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.skills.strides import CARRIED, SETTLING, home, settled, straight
from murmillo.envs.motion.authored.take import Key, Take

# The slower the body, the more the thigh leads and the less the knee folds, or the foot would first fly back.
SLOWEST = replace(RUNNING, legs=((0.25, 12.0, 74.0, 25.0), (0.50, 30.0, 80.0, 22.0), (0.75, 39.0, 60.0, 12.0)))
SLOWER = replace(RUNNING, legs=((0.25, 2.0, 78.0, 62.0), (0.50, 24.0, 88.0, 50.0), (0.75, 41.0, 68.0, 22.0)))


def run_forward() -> Take:
    """From guard into a run at 2.9 m/s and back, the body flying between its steps."""
    running = GUARD.but(
        height=0.727,
        hips=(-2.0, 9.0, 0.0),
        chest=(-6.0, 13.0, 0.0),
        hand=(0.02, -0.32, -0.30),
        blade=(-4.0, 38.0, 0.0),
        shield=(0.28, 0.16, -0.20),
        face=(26.0, 0.0, 28.0),
    )
    braking = CARRIED.but(height=0.705, hips=(-6.0, 0.0, 0.0), chest=(-14.0, -2.0, 0.0))
    # Frames of 1/30 s. It brakes in short quick steps, for a long one would lock the knee.
    beats = [0.0, 12.0, 11.0, *[10.0] * 5, 9.0, 9.0, 9.0, 10.0, 11.0, 12.0]
    lengths = [0.46, 0.67, 0.88, 1.02, 1.01, 0.97, 0.93, 0.88, 0.78, 0.66, 0.55, 0.44, 0.34, 0.26]
    flights = [-2.0, 1.0, 3.0, *[4.0] * 5, 3.0, 2.0, 1.0, -1.0, -2.0, -3.0]
    leaving = Swing(lift=0.08, push=40.0, push_time=0.18, strike=4.0)
    braked = Swing(lift=0.06, push=30.0, push_time=0.16, strike=10.0, flat_time=0.08)
    falls = straight(
        lengths,
        first=0.9,
        beat=np.array(beats) / 30.0,
        swing=[leaving, SLOWEST, SLOWER, *[RUNNING] * 6, SLOWER, *[braked] * 4],
        flight=np.array(flights) / 30.0,
        width=0.05,
        toe_out=4.0,
    )
    falls += home(falls[-1], beat=0.42, swing=SETTLING)
    carriage = Carriage(running, rise=0.0, turn=8.0, counter=12.0, drop=3.0, hand=0.10, shield=0.03)
    keys = [
        Key(0.0, GUARD),
        Key(0.4, GUARD.but(weight=0.40, height=0.74, hips=(-10.0, 8.0, 0.0), chest=(-22.0, 16.0, 0.0))),
        *keys_between(carriage, falls[:7]),
        *keys_between(Carriage(braking, rise=0.0, turn=7.0, counter=9.0, hand=0.07), falls[7:-2]),
    ]
    return Take("run_forward", keys + settled(falls[-1].time), steps_between(falls, 0.5), sway=0.10)


def run_backward() -> Take:
    """Backpedals at 2 m/s on the balls of the feet, behind the shield."""
    fleeing = GUARD.but(height=0.716, hips=(-8.0, 8.0, 0.0), chest=(-18.0, 14.0, 0.0), shield=(0.33, 0.10, -0.17))
    springy = Swing(lift=0.09, push=26.0, push_time=0.12, strike=-20.0, flat_time=0.12)
    beats = [0.0, 12.0, 11.0, *[10.0] * 8, 12.0]
    lengths = [-0.06, -0.18, -0.34, -0.50, -0.60, *[-0.68] * 5, -0.60, -0.46]
    flights = [-2.0, -2.0, 0.0, 1.0, *[2.0] * 7, -1.0]
    falls = straight(lengths, first=0.85, beat=np.array(beats) / 30.0, swing=springy, flight=np.array(flights) / 30.0)
    falls += home(falls[-1], beat=0.42, swing=Swing(lift=0.05, push=8.0, strike=-10.0))
    carriage = Carriage(fleeing, rise=0.0, turn=6.0, counter=7.0, drop=2.0, hand=0.05, ahead=-1.0)
    keys = [
        Key(0.0, GUARD),
        Key(0.3, GUARD.but(weight=0.34, height=0.74)),
        *keys_between(carriage, falls[:-3]),
    ]
    return Take("run_backward", keys + settled(falls[-1].time), steps_between(falls, 0.5), sway=0.08)


def run_left() -> Take:
    """Gallops sideways to the left at 1.9 m/s: the right leg thrusts, the body flies, the feet never cross."""
    return _gallop("run_left", 1.0)


def run_right() -> Take:
    """Gallops sideways to the right at 1.9 m/s: the left leg thrusts, the body flies, the feet never cross."""
    return _gallop("run_right", -1.0)


def _gallop(label: str, side: float) -> Take:
    opening, closing = ("left", "right") if side > 0.0 else ("right", "left")
    swing = Swing(lift=0.055, push=20.0, push_time=0.14, strike=-6.0, flat_time=0.09)
    # Frames of 1/30 s: how long the body flies on to the opening foot, and how soon the closing one follows.
    slow, hopping = [(0.32, -2.0, 9.0), (0.50, 0.0, 6.0), (0.62, 2.0, 4.0)], (0.77, 3.0, 4.0)
    cycles = [*slow, *[hopping] * 5, (0.72, 3.0, 4.0), *reversed(slow)]
    falls, frame, y = [], 25.0, 0.0
    for count, (advance, flight, follows) in enumerate(cycles, 1):
        y += advance * side
        # The feet come nearly abreast, for the legs are too short to straddle both ways.
        abreast = 0.0 if count == len(cycles) else 0.09
        spots = {"left": ahead(LEFT, -abreast, y), "right": ahead(RIGHT, abreast, y)}
        falls.append(Footfall(opening, frame / 30.0, spots[opening], flight / 30.0, swing))
        frame += follows
        falls.append(Footfall(closing, frame / 30.0, spots[closing], -2.0 / 30.0, swing))
        frame += 8.0
    flying = GUARD.but(
        height=0.694, hips=(-14.0, 6.0, 3.0 * side), chest=(-22.0, 10.0, -2.0 * side), gaze=(14.0 * side, 0.0),
        hand=(0.08, -0.34, -0.26), shield=(0.32, 0.12, -0.15),
    )  # fmt: skip
    gathered = flying.but(
        height=0.684, hips=(-14.0, 6.0, -2.0 * side), chest=(-24.0, 12.0, 2.0 * side), hand=(0.09, -0.31, -0.29),
        shield=(0.33, 0.10, -0.18),
    )  # fmt: skip
    ready = GUARD.but(weight=0.5 + 0.16 * side, height=0.73, gaze=(16.0 * side, 0.0))
    keys = [Key(0.0, GUARD), Key(0.35, ready)]
    keys += [Key(fall.time, flying if fall.foot == opening else gathered) for fall in falls]
    return Take(label, keys + settled(falls[-1].time), steps_between(falls, 0.5), sway=0.08)
