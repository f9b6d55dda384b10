"""The gaits of the humanoid: a walk, a run, and short styles, each an exaggeration that an animator would name at once.

Phases count from the right footfall; see `cycle.Gait` for the words.
"""

from murmillo.envs.motion.authored.cycle import ArmCycle, Gait, LegCycle, wave


def walk() -> Gait:
    """A natural walk at 1.1 m/s: timing and angles as Winter (1991) has them."""
    return Gait("walk", frames=33, length=1.22, strides=4)


def run() -> Gait:
    """An easy run at 2.0 m/s: 37 % of the stride on the ground, a flight after each push (Novacheck 1998)."""
    leg = LegCycle(
        stance=0.37, ahead=0.15, apart=0.045, toe_out=5.0, strike=3.0, flat=0.06, heel_off=0.15, push=48.0, lift=0.09,
        swing=((0.0, -20.0, 22.0, -18.0), (0.1, -17.0, 36.0, -18.0), (0.25, -7.0, 62.0, -12.0), (0.5, 20.0, 76.0, 0.0),
               (0.75, 35.0, 54.0, 6.0), (1.0, 24.0, 18.0, 4.0)),
    )  # fmt: skip
    arm = ArmCycle(
        swing=wave(-10.0, (20.0, 1, 0.52)), out=wave(12.0), twist=wave(30.0), elbow=wave(92.0, (6.0, 1, 0.52))
    )
    return Gait(
        "run", frames=25, length=1.66, strides=6, leg=leg, arm=arm, straight=15.0,
        rise=wave(0.0, (0.027, 2, 0.44)), sway=wave(0.0, (0.012, 1, 0.72)), surge=wave(0.0, (0.006, 2, 0.3)),
        hips=(wave(0.0, (6.0, 1, 0.95)), wave(8.0, (2.0, 2, 0.4)), wave(0.0, (4.0, 1, 0.65))),
        chest=(wave(0.0, (7.0, 1, 0.47)), wave(10.0, (1.5, 2, 0.15)), wave(0.0, (1.5, 1, 0.2))),
        head=(wave(0.0), wave(4.0, (1.5, 2, 0.2)), wave(0.0)),
    )  # fmt: skip


def stoop() -> Gait:
    """Bent with age: the back round, the knees never straight, short flat steps, the arms hanging."""
    leg = LegCycle(
        stance=0.66, ahead=0.19, apart=0.085, toe_out=14.0, strike=5.0, flat=0.08, heel_off=0.45, push=24.0, lift=0.015,
        swing=((0.0, 14.0, 42.0, -2.0), (0.25, 22.0, 58.0, 2.0), (0.5, 30.0, 58.0, 6.0),
               (0.75, 33.0, 44.0, 8.0), (1.0, 30.0, 32.0, 6.0)),
    )  # fmt: skip
    arm = ArmCycle(swing=wave(52.0, (7.0, 1, 0.55)), out=wave(10.0), twist=wave(20.0), elbow=wave(32.0, (5.0, 1, 0.6)))
    return Gait(
        "stoop", frames=36, length=0.72, strides=2, leg=leg, arm=arm, straight=22.0, crouch=0.02,
        rise=wave(0.0, (0.008, 2, 0.33)), sway=wave(0.0, (0.03, 1, 0.82)),
        hips=(wave(0.0, (4.0, 1, 0.0)), wave(20.0, (1.5, 2, 0.1)), wave(0.0, (3.0, 1, 0.68))),
        chest=(wave(0.0, (4.0, 1, 0.5)), wave(50.0, (2.0, 2, 0.15)), wave(0.0, (4.0, 1, 0.3))),
        head=(wave(0.0, (3.0, 1, 0.5)), wave(22.0, (3.0, 2, 0.3)), wave(0.0)),
    )  # fmt: skip


def limp() -> Gait:
    """The right leg hurts: it is kept stiff, swung round, and left as soon as it has borne the lurching body."""
    hurt = LegCycle(
        stance=0.515, ahead=0.16, apart=0.085, outward=0.06, toe_out=16.0, strike=6.0, flat=0.06, heel_off=0.30,
        push=16.0, lift=0.035,
        swing=((0.0, -4.0, 20.0, -4.0), (0.25, 4.0, 26.0, 0.0), (0.5, 12.0, 26.0, 2.0), (0.75, 17.0, 20.0, 2.0),
               (1.0, 15.0, 12.0, 2.0)),
    )  # fmt: skip
    sound = LegCycle(stance=0.66, ahead=0.20, apart=0.07, strike=12.0, heel_off=0.40, push=48.0, lift=0.07)
    pressed = ArmCycle(
        swing=wave(12.0, (4.0, 1, 0.4)), out=wave(14.0), twist=wave(30.0), elbow=wave(30.0, (5.0, 1, 0.2))
    )
    swung = ArmCycle(
        swing=wave(-10.0, (24.0, 1, 0.55)), out=wave(24.0, (8.0, 1, 0.6)), elbow=wave(38.0, (10.0, 1, 0.6))
    )
    return Gait(
        "limp", frames=36, length=0.78, strides=2, leg=hurt, other_leg=sound, arm=pressed, other_arm=swung, offset=0.43,
        straight=8.0,
        rise=wave(0.0, (0.014, 1, 0.24), (0.008, 2, 0.25)), sway=wave(0.0, (0.035, 1, 0.76)),
        surge=wave(0.0, (0.02, 1, 0.35)),
        hips=(wave(-4.0, (5.0, 1, 0.05)), wave(8.0, (3.0, 1, 0.2)), wave(3.0, (6.0, 1, 0.2))),
        chest=(wave(-3.0, (5.0, 1, 0.55)), wave(14.0, (6.0, 1, 0.22)), wave(5.0, (10.0, 1, 0.24))),
        head=(wave(0.0), wave(12.0, (6.0, 1, 0.25)), wave(2.0, (4.0, 1, 0.3))),
    )  # fmt: skip


def march() -> Gait:
    """On parade: knees lifted level, feet set down flat, straight arms to the chest's height, nothing else moves."""
    leg = LegCycle(
        stance=0.56, ahead=0.20, apart=0.06, toe_out=6.0, strike=3.0, flat=0.05, heel_off=0.38, push=34.0, lift=0.0,
        swing=((0.0, 4.0, 42.0, -14.0), (0.25, 44.0, 88.0, -10.0), (0.5, 70.0, 92.0, -4.0), (0.75, 48.0, 52.0, 0.0),
               (1.0, 18.0, 8.0, 0.0)),
    )  # fmt: skip
    arm = ArmCycle(swing=wave(14.0, (46.0, 1, 0.52)), out=wave(7.0), twist=wave(0.0), elbow=wave(10.0, (4.0, 1, 0.5)))
    return Gait(
        "march", frames=34, length=1.0, strides=2, leg=leg, arm=arm, straight=8.0,
        rise=wave(0.0, (0.010, 2, 0.31)), sway=wave(0.0, (0.022, 1, 0.80)),
        hips=(wave(0.0, (2.0, 1, 0.0)), wave(-2.0), wave(0.0, (2.0, 1, 0.3))),
        chest=(wave(0.0, (3.0, 1, 0.5)), wave(-4.0, (1.0, 2, 0.1)), wave(0.0)),
        head=(wave(0.0), wave(-3.0), wave(0.0)),
    )  # fmt: skip


def strut() -> Gait:
    """Cock of the walk: chest out, chin up, elbows wide, the shoulders swung with every slow, straight-legged step."""
    leg = LegCycle(
        stance=0.60, ahead=0.29, apart=0.075, toe_out=16.0, strike=22.0, flat=0.10, heel_off=0.30, push=50.0,
        swing=((0.0, -4.0, 36.0, -16.0), (0.25, 18.0, 56.0, -8.0), (0.5, 34.0, 42.0, 2.0), (0.75, 34.0, 14.0, 6.0),
               (1.0, 22.0, 5.0, 4.0)),
    )  # fmt: skip
    arm = ArmCycle(
        swing=wave(-18.0, (26.0, 1, 0.5)),
        out=wave(30.0, (5.0, 2, 0.3)),
        twist=wave(25.0),
        elbow=wave(44.0, (10.0, 1, 0.5)),
    )
    return Gait(
        "strut", frames=36, length=1.18, strides=2, leg=leg, arm=arm, straight=7.0,
        rise=wave(0.0, (0.015, 2, 0.33)), sway=wave(0.0, (0.035, 1, 0.80)),
        hips=(wave(0.0, (7.0, 1, 0.0)), wave(-6.0, (2.0, 2, 0.1)), wave(0.0, (5.0, 1, 0.66))),
        chest=(wave(0.0, (15.0, 1, 0.5)), wave(-17.0, (3.0, 2, 0.35)), wave(0.0, (7.0, 1, 0.28))),
        head=(wave(0.0, (4.0, 1, 0.5)), wave(-10.0, (2.0, 2, 0.3)), wave(0.0, (3.0, 1, 0.3))),
    )  # fmt: skip


def penguin() -> Gait:
    """A waddle: stiff legs, feet turned out, the whole body rolling over each short step, arms held out as flippers."""
    leg = LegCycle(
        stance=0.62, ahead=0.10, apart=0.10, toe_out=30.0, strike=0.0, flat=0.05, heel_off=0.42, push=10.0, lift=0.04,
        swing=((0.0, -2.0, 14.0, -4.0), (0.25, 4.0, 20.0, 0.0), (0.5, 8.0, 22.0, 2.0), (0.75, 10.0, 18.0, 2.0),
               (1.0, 8.0, 12.0, 0.0)),
    )  # fmt: skip
    arm = ArmCycle(
        swing=wave(-14.0, (5.0, 1, 0.5)),
        out=wave(26.0, (8.0, 1, 0.8)),
        twist=wave(-30.0),
        elbow=wave(10.0, (4.0, 1, 0.3)),
    )
    return Gait(
        "penguin", frames=21, length=0.40, strides=3, leg=leg, arm=arm, straight=12.0,
        rise=wave(0.0, (0.010, 2, 0.32)), sway=wave(0.0, (0.06, 1, 0.81)), surge=wave(0.0),
        hips=(wave(0.0, (7.0, 1, 0.0)), wave(-3.0), wave(0.0, (9.0, 1, 0.30))),
        chest=(wave(0.0, (4.0, 1, 0.0)), wave(-6.0), wave(0.0, (16.0, 1, 0.30))),
        head=(wave(0.0), wave(-2.0), wave(0.0, (5.0, 1, 0.30))),
    )  # fmt: skip


def jaunty() -> Gait:
    """A spring in every step: up on the toes, down into the knees, loose arms, the head keeping time."""
    leg = LegCycle(
        stance=0.56, ahead=0.24, apart=0.05, toe_out=10.0, strike=14.0, flat=0.08, heel_off=0.20, push=58.0, lift=0.02,
        swing=((0.0, -2.0, 40.0, -20.0), (0.25, 22.0, 76.0, -12.0), (0.5, 40.0, 68.0, 0.0), (0.75, 38.0, 32.0, 4.0),
               (1.0, 20.0, 10.0, 2.0)),
    )  # fmt: skip
    arm = ArmCycle(
        swing=wave(-6.0, (32.0, 1, 0.52)),
        out=wave(16.0, (5.0, 2, 0.45)),
        twist=wave(20.0),
        elbow=wave(40.0, (16.0, 1, 0.55)),
    )
    return Gait(
        "jaunty", frames=32, length=1.08, strides=2, leg=leg, arm=arm, straight=9.0,
        rise=wave(0.0, (0.034, 2, 0.40)), sway=wave(0.0, (0.028, 1, 0.80)),
        hips=(wave(0.0, (8.0, 1, 0.0)), wave(2.0, (2.0, 2, 0.1)), wave(0.0, (6.0, 1, 0.66))),
        chest=(wave(0.0, (9.0, 1, 0.5)), wave(-5.0, (3.0, 2, 0.15)), wave(0.0, (6.0, 1, 0.28))),
        head=(wave(0.0, (4.0, 1, 0.0)), wave(-4.0, (5.0, 2, 0.12)), wave(0.0, (7.0, 1, 0.30))),
    )  # fmt: skip


GAITS = (walk, run, stoop, limp, march, strut, penguin, jaunty)
