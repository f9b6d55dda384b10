"""Onto the belly and up again: the get-up begins as the fall ends."""

from murmillo.envs.motion.authored.feet import Place
from murmillo.envs.motion.authored.floor import FloorTake
from murmillo.envs.motion.authored.skills.guard_pose import FLAT, GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.tumbler import Low, Stand, planted

# On the belly, draped over the shield, the sword ahead.
ON_FRONT = Low(
    pelvis=(0.62, 0.0, 0.10),
    hips=(0.0, 86.0, 0.0),
    chest=(0.0, 76.0, 0.0),
    head=(0.0, 66.0, 0.0),
    points={
        "left_toe": (-0.22, 0.20, 0.0),
        "right_toe": (-0.24, -0.18, 0.0),
        "shield": (1.08, 0.30, 0.03),
        "right_lower_arm": (1.0, -0.42, 0.06),
        "right_hand": (1.20, -0.36, 0.045),
        "sword": (1.90, -0.30, 0.015),
    },
    face=(0.0, -88.0, 20.0),
)


def fall_front() -> FloorTake:
    """The knees give: down on the right, then the left, shield and fist catch the chest, the legs stretch out."""
    toe, knee = planted(right=RIGHT)["right_toe"], (0.26, -0.16, 0.055)
    buckle = Low(
        pelvis=(0.08, 0.01, 0.66),
        hips=(0.0, 14.0, -10.0),
        chest=(0.0, 24.0, -14.0),
        head=(0.0, 20.0, 0.0),
        points={**planted(left=LEFT), "right_toe": toe},
        soles={"left": FLAT["left"], "right": (RIGHT.yaw, 24.0)},
        hand=(0.20, -0.36, -0.32),
        shield=(0.36, 0.12, -0.14),
        blade=(-10.0, 20.0, 0.0),
        face=(10.0, -10.0, 30.0),
    )
    kneel = Low(
        pelvis=(0.28, 0.0, 0.44),
        hips=(0.0, 22.0, -8.0),
        chest=(0.0, 40.0, -10.0),
        head=(0.0, 24.0, 0.0),
        points={"left_toe": planted(left=LEFT)["left_toe"], "right_toe": toe, "right_shin": knee},
        soles={"left": (LEFT.yaw, 34.0)},
        hand=(0.14, -0.42, -0.36),
        shield=(0.34, 0.24, -0.22),
        blade=(-18.0, 6.0, 0.0),
        face=(12.0, -24.0, 25.0),
    )
    reach = kneel.without("left_toe", "left").but(
        pelvis=(0.40, 0.0, 0.41),
        hips=(0.0, 42.0, -4.0),
        chest=(0.0, 56.0, -4.0),
        head=(0.0, 36.0, 0.0),
        points={"left_shin": (0.36, 0.16, 0.055)},
        hand=(0.22, -0.42, -0.38),
        shield=(0.30, 0.32, -0.32),
        blade=(-14.0, 2.0, 0.0),
        face=(8.0, -58.0, 20.0),
    )
    catch = Low(
        pelvis=(0.57, 0.0, 0.27),
        hips=(0.0, 74.0, 0.0),
        chest=(0.0, 78.0, 0.0),
        head=(0.0, 44.0, 0.0),
        points={
            "right_toe": toe,
            "right_shin": knee,
            "left_shin": (0.36, 0.16, 0.055),
            "right_hand": (1.12, -0.38, 0.045),
            "shield": ON_FRONT.points["shield"],
        },
        blade=(-4.0, 1.0, 0.0),
        face=ON_FRONT.face,
    )
    down = ON_FRONT.but(pelvis=(0.60, 0.0, 0.16), hips=(0.0, 82.0, 0.0), head=(0.0, 50.0, 0.0))
    return FloorTake(
        "fall_front",
        [
            (0.0, Stand(GUARD)),
            (0.34, buckle),
            (0.64, kneel),
            (0.88, reach),
            (1.17, catch),
            (1.54, down.without("left_toe", "right_toe")),
            (1.9, ON_FRONT.but(head=(0.0, 74.0, 0.0))),
            (2.35, ON_FRONT.but(head=(0.0, 60.0, 0.0), chest=(0.0, 74.0, 0.0))),
            (2.8, ON_FRONT),
        ],
    )


def get_up_front() -> FloorTake:
    """Pushes up over shield and fist onto the knees, sets the left foot ahead, rises over it, closes the stance."""
    stand = Stand(GUARD, 0.46, 0.02)
    left = Place(LEFT.x + stand.x, LEFT.y + stand.y, LEFT.yaw)
    hands = {"right_hand": (1.06, -0.34, 0.042), "shield": ON_FRONT.points["shield"]}
    toes = {name: ON_FRONT.points[name] for name in ("left_toe", "right_toe")}
    knees = {"left_shin": (0.20, 0.16, 0.055), "right_shin": (0.19, -0.16, 0.055)}
    gather = ON_FRONT.without("sword", "right_lower_arm").but(
        head=(0.0, 46.0, 0.0),
        points={"right_hand": hands["right_hand"]},
        blade=(0.0, 1.0, 0.0),
    )
    push = Low(
        pelvis=(0.56, 0.0, 0.20),
        hips=(0.0, 72.0, 0.0),
        chest=(0.0, 62.0, 0.0),
        head=(0.0, 34.0, 0.0),
        points={**hands, **toes, **knees},
        blade=(0.0, 1.0, 0.0),
        face=ON_FRONT.face,
    )
    kneeling = push.without("shield").but(
        pelvis=(0.44, 0.0, 0.40),
        hips=(0.0, 62.0, 0.0),
        chest=(0.0, 64.0, -6.0),
        head=(0.0, 30.0, 0.0),
        shield=(0.28, 0.24, -0.30),
        face=(0.0, -60.0, 20.0),
    )
    step = Low(
        pelvis=(0.40, 0.0, 0.44),
        hips=(0.0, 40.0, 0.0),
        chest=(0.0, 52.0, -8.0),
        head=(0.0, 20.0, 0.0),
        points={**planted(left=left), "right_toe": toes["right_toe"], "right_shin": knees["right_shin"]}
        | {"right_hand": hands["right_hand"]},
        soles={"left": FLAT["left"]},
        shield=(0.36, 0.20, -0.24),
        blade=(0.0, 1.0, 0.0),
        face=(10.0, -30.0, 25.0),
    )
    upright = step.without("right_hand").but(
        pelvis=(0.29, 0.02, 0.46),
        hips=(0.0, 12.0, -8.0),
        chest=(0.0, 18.0, -14.0),
        head=(0.0, 4.0, 0.0),
        hand=(0.12, -0.32, -0.32),
        shield=(0.33, 0.12, -0.15),
        blade=(0.0, 16.0, 0.0),
        face=(12.0, 0.0, 30.0),
    )
    rise = upright.without("right_toe", "right_shin").but(
        pelvis=(0.52, 0.06, 0.62),
        hips=(0.0, 22.0, -6.0),
        chest=(0.0, 30.0, -12.0),
        head=(0.0, 6.0, 0.0),
        points={"right_foot": (0.02, -0.14, 0.14)},
        blade=(0.0, 24.0, 0.0),
    )
    return FloorTake(
        "get_up_front",
        [
            (0.0, ON_FRONT),
            (0.2, ON_FRONT),
            (0.65, gather),
            (1.2, push),
            (1.75, kneeling),
            (2.4, step),
            (2.95, upright),
            (3.5, rise),
            (4.0, Stand(GUARD.but(height=0.745, weight=0.45), stand.x, stand.y)),
            (4.4, stand),
            (4.6, stand),
        ],
    )
