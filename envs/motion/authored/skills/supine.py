"""Onto the back and up again: the get-up begins as the fall ends."""

from murmillo.envs.motion.authored.feet import Place
from murmillo.envs.motion.authored.floor import FloorTake
from murmillo.envs.motion.authored.skills.guard_pose import FLAT, GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.tumbler import Low, Stand, planted

BACK_LEFT = Place(-0.245, 0.167, 4.0)
# On the back, head away from the opponent: one knee up, the shield over the belly, the sword flat on the ground.
ON_BACK = Low(
    pelvis=(-0.66, 0.0, 0.09),
    hips=(0.0, -88.0, 0.0),
    chest=(0.0, -86.0, 0.0),
    head=(0.0, -66.0, 0.0),
    points={
        **planted(left=BACK_LEFT),
        "right_heel": (0.14, -0.26, 0.0),
        "left_lower_arm": (-0.86, 0.40, 0.06),
        "left_hand": (-0.76, 0.20, 0.27),
        "right_lower_arm": (-1.02, -0.42, 0.06),
        "right_hand": (-0.80, -0.56, 0.045),
        "sword": (-0.10, -0.78, 0.015),
    },
    soles={"left": FLAT["left"]},
)


def fall_back() -> FloorTake:
    """Struck on the shield: reels, sits down behind the heels, rolls onto the back with the chin tucked."""
    reel = Low(
        pelvis=(-0.10, 0.02, 0.76),
        hips=(0.0, -8.0, -12.0),
        chest=(0.0, -14.0, -14.0),
        head=(0.0, 4.0, 0.0),
        points=planted(left=LEFT, right=RIGHT),
        soles=FLAT,
        hand=(0.06, -0.46, -0.18),
        shield=(0.32, 0.16, -0.12),
        blade=(-20.0, 50.0, 0.0),
        face=(20.0, 10.0, 40.0),
    )
    sink = reel.but(
        pelvis=(-0.36, 0.01, 0.52),
        hips=(0.0, -14.0, -6.0),
        chest=(0.0, 6.0, -6.0),
        head=(0.0, 16.0, 0.0),
        hand=(0.04, -0.52, -0.24),
        shield=(0.36, 0.18, -0.02),
        blade=(-30.0, 40.0, 0.0),
        face=(15.0, 15.0, 40.0),
    )
    sit = Low(
        pelvis=(-0.60, 0.0, 0.10),
        hips=(0.0, -42.0, 0.0),
        chest=(0.0, -16.0, 0.0),
        head=(0.0, 10.0, 0.0),
        points={**planted(right=RIGHT), "left_heel": planted(left=LEFT)["left_heel"]},
        soles={"left": (4.0, -22.0), "right": FLAT["right"]},
        hand=(-0.06, -0.52, -0.30),
        shield=(0.28, 0.24, 0.14),
        blade=(-40.0, 25.0, 45.0),
        face=(25.0, 30.0, 40.0),
    )
    roll = Low(
        pelvis=(-0.66, 0.0, 0.13),
        hips=(0.0, -98.0, 0.0),
        chest=(0.0, -74.0, 0.0),
        head=(0.0, -46.0, 0.0),
        points={
            "torso": (-0.89, 0.0, 0.11),
            "left_foot": (0.0, 0.16, 0.36),
            "right_foot": (0.02, -0.22, 0.26),
            "right_lower_arm": (-1.02, -0.42, 0.06),
            "right_hand": (-0.84, -0.58, 0.045),
            "sword": (-0.14, -0.82, 0.015),
        },
        shield=(0.10, 0.32, 0.34),
        face=(40.0, 60.0, 40.0),
    )
    return FloorTake(
        "fall_back",
        [
            (0.0, Stand(GUARD)),
            (0.26, reel),
            (0.56, sink),
            (0.86, sit),
            (1.22, roll),
            (1.80, ON_BACK.but(head=(0.0, -76.0, 0.0))),
            (2.3, ON_BACK.but(head=(0.0, -62.0, 0.0), chest=(0.0, -83.0, 0.0))),
            (2.9, ON_BACK),
        ],
    )


def get_up_back() -> FloorTake:
    """The technical stand-up: sits up onto the sword fist, lifts the hips, swings the right leg under, stands."""
    stand = Stand(GUARD, BACK_LEFT.x - LEFT.x, BACK_LEFT.y - LEFT.y)
    left, right = BACK_LEFT, Place(RIGHT.x + stand.x, RIGHT.y + stand.y, RIGHT.yaw)
    heel, post = (-0.16, -0.22, 0.0), {"right_hand": (-1.02, -0.40, 0.042)}
    draw_in = ON_BACK.but(
        chest=(0.0, -78.0, 0.0),
        head=(0.0, -48.0, 0.0),
        points={"right_heel": heel},
    )
    sitting_up = Low(
        pelvis=(-0.66, 0.0, 0.09),
        hips=(0.0, -62.0, -6.0),
        chest=(0.0, -46.0, -22.0),
        head=(0.0, -22.0, 0.0),
        points={
            **planted(left=left),
            "right_heel": heel,
            "right_lower_arm": (-1.06, -0.34, 0.07),
            "right_hand": (-0.98, -0.52, 0.10),
        },
        soles={"left": FLAT["left"]},
        shield=(0.30, 0.18, 0.10),
        blade=(-30.0, 2.0, 0.0),
        face=(20.0, 25.0, 40.0),
    )
    seated = Low(
        pelvis=(-0.64, -0.01, 0.09),
        hips=(0.0, -34.0, -10.0),
        chest=(0.0, -16.0, -24.0),
        head=(0.0, 0.0, -4.0),
        points={**planted(left=left), **post, "right_heel": heel},
        soles={"left": FLAT["left"]},
        shield=(0.33, 0.16, -0.02),
        blade=(-50.0, 1.0, 0.0),
        face=(14.0, 10.0, 40.0),
    )
    lifted = seated.without("right_heel").but(
        pelvis=(-0.60, -0.02, 0.32),
        hips=(-30.0, 10.0, 10.0),
        chest=(-60.0, 24.0, 40.0),
        head=(0.0, 10.0, 0.0),
        points={"right_foot": (-0.40, -0.24, 0.10)},
        face=(14.0, 5.0, 40.0),
    )
    under = lifted.without("right_foot", "right_hand").but(
        pelvis=(-0.50, 0.0, 0.42),
        hips=(-20.0, 24.0, 8.0),
        chest=(-40.0, 32.0, 26.0),
        head=(0.0, 14.0, 0.0),
        points={"right_toe": planted(right=right)["right_toe"]},
        soles={"right": (RIGHT.yaw, 45.0)},
        hand=(0.0, -0.36, -0.44),
        shield=(0.33, 0.16, -0.04),
        blade=(-30.0, 8.0, 0.0),
        face=(14.0, 0.0, 40.0),
    )
    rise = under.but(
        pelvis=(-0.47, 0.03, 0.60),
        hips=(0.0, 16.0, -14.0),
        chest=(0.0, 26.0, -20.0),
        head=(0.0, 8.0, 0.0),
        points=planted(right=right),
        soles=FLAT,
        hand=(0.08, -0.32, -0.32),
        shield=(0.33, 0.12, -0.15),
        blade=(0.0, 26.0, 0.0),
        face=(12.0, 0.0, 30.0),
    )
    return FloorTake(
        "get_up_back",
        [
            (0.0, ON_BACK),
            (0.2, ON_BACK),
            (0.75, draw_in),
            (1.25, sitting_up),
            (1.65, seated),
            (2.15, lifted),
            (2.6, under),
            (3.1, rise),
            (3.6, stand),
            (3.8, stand),
        ],
    )
