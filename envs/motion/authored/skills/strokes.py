"""The cuts of the sword as poses, so that single slashes and combinations strike alike."""

from dataclasses import dataclass

from murmillo.envs.motion.authored.body import Pose
from murmillo.envs.motion.authored.skills.guard_pose import GUARD
from murmillo.envs.motion.authored.take import Key

# From the wound-up pose on [s]: the hips go first, the blade is midway 0.18 s later and past its mark in 0.14 s more.
LOOSED, MIDWAY, THROUGH, SPENT = 0.10, 0.28, 0.42, 0.60


@dataclass(frozen=True)
class Stroke:
    """A cut: wound up; loosed, when hips and chest turn and the blade is left behind; midway; through; spent.

    `pace` stretches its times: a cut against the weight of the blade is slower.
    """

    wound: Pose
    loosed: Pose
    midway: Pose
    through: Pose
    spent: Pose
    pace: float = 1.0

    def keys(self, start: float) -> list[Key]:
        """Wound up at `start` [s], spent about 0.6 s later."""
        return [*self.flowing(start), Key(start + self.pace * SPENT, self.spent)]

    def flowing(self, start: float) -> list[Key]:
        """The same without coming to rest: the next stroke takes over what is left of the swing."""
        return [
            Key(start, self.wound),
            Key(start + self.pace * LOOSED, self.loosed),
            Key(start + self.pace * MIDWAY, self.midway),
            Key(start + self.pace * THROUGH, self.through),
        ]


def _stroke(wound: Pose, loosed: dict, midway: Pose, through: dict, spent: dict, pace: float = 1.0) -> Stroke:
    """Each later pose told by what it changes of the one before it in the same half of the cut."""
    past = midway.but(**through)
    return Stroke(wound, wound.but(**loosed), midway, past, past.but(**spent), pace)


# From over the right shoulder down through the middle.
DOWN = _stroke(
    GUARD.but(
        height=0.785,
        weight=0.64,
        hips=(-26.0, 1.0, 1.0),
        chest=(-42.0, -3.0, 3.0),
        hand=(-0.06, -0.33, 0.17),
        blade=(12.0, 115.0, 0.0),
        shield=(0.36, 0.05, -0.10),
        face=(2.0, 0.0, 35.0),
    ),
    {"weight": 0.5, "hips": (-16.0, 3.0, 0.0), "chest": (-36.0, 0.0, 2.0), "hand": (0.02, -0.32, 0.20)},
    GUARD.but(
        height=0.745,
        weight=0.30,
        hips=(2.0, 7.0, 0.0),
        chest=(14.0, 12.0, 0.0),
        hand=(0.50, -0.12, -0.08),
        blade=(2.0, 22.0, 0.0),
        shield=(0.20, 0.26, -0.22),
        face=(42.0, 0.0, 30.0),
    ),
    {
        "height": 0.735,
        "chest": (24.0, 20.0, -2.0),
        "hand": (0.38, -0.02, -0.40),
        "blade": (14.0, -38.0, 8.0),
        "shield": (0.12, 0.34, -0.24),
        "face": (62.0, 0.0, 25.0),
    },
    {"hand": (0.33, 0.0, -0.43), "chest": (26.0, 21.0, -2.0), "weight": 0.34},
)

# From beside the right knee up past the face, the back edge down and the palm up.
UP = _stroke(
    GUARD.but(
        height=0.725,
        weight=0.66,
        hips=(-32.0, 7.0, 3.0),
        chest=(-50.0, 16.0, 10.0),
        hand=(-0.14, -0.40, -0.40),
        blade=(-122.0, -36.0, 90.0),
        shield=(0.36, 0.04, -0.12),
        face=(0.0, 0.0, 32.0),
    ),
    {"weight": 0.52, "hips": (-20.0, 7.0, 2.0), "chest": (-42.0, 15.0, 8.0), "hand": (-0.04, -0.41, -0.44)},
    GUARD.but(
        height=0.760,
        weight=0.34,
        hips=(0.0, 4.0, 0.0),
        chest=(4.0, 7.0, 0.0),
        hand=(0.42, -0.24, -0.30),
        blade=(-14.0, -22.0, 145.0),
        shield=(0.16, 0.30, -0.22),
        face=(50.0, 0.0, 28.0),
    ),
    {
        "height": 0.790,
        "weight": 0.32,
        "chest": (22.0, -4.0, -4.0),
        "hand": (0.34, -0.06, 0.18),
        "blade": (18.0, 72.0, 160.0),
        "shield": (0.08, 0.34, -0.26),
        "face": (70.0, 0.0, 20.0),
    },
    {"hand": (0.28, -0.06, 0.21), "blade": (24.0, 84.0, 160.0), "chest": (24.0, -6.0, -4.0)},
    pace=1.2,
)

# Level, from the right to the left, the shield drawn away as a counterweight.
LEFTWARD = _stroke(
    GUARD.but(
        height=0.765,
        weight=0.64,
        hips=(-30.0, 3.0, 0.0),
        chest=(-52.0, 4.0, 2.0),
        hand=(-0.04, -0.46, -0.03),
        blade=(-85.0, 35.0, 60.0),
        shield=(0.36, 0.02, -0.12),
        face=(-4.0, 0.0, 32.0),
    ),
    {"weight": 0.5, "hips": (-20.0, 4.0, 0.0), "chest": (-42.0, 5.0, 1.0), "blade": (-88.0, 22.0, 75.0)},
    GUARD.but(
        height=0.745,
        weight=0.34,
        hips=(4.0, 5.0, 0.0),
        chest=(7.0, 9.0, 0.0),
        hand=(0.46, -0.20, -0.12),
        blade=(-26.0, 3.0, 84.0),
        shield=(0.14, 0.32, -0.20),
        face=(55.0, 0.0, 28.0),
    ),
    {
        "height": 0.75,
        "chest": (34.0, 10.0, -2.0),
        "hips": (10.0, 4.0, 0.0),
        "hand": (0.40, 0.10, -0.10),
        "blade": (72.0, 2.0, 85.0),
        "shield": (0.02, 0.36, -0.26),
        "face": (85.0, 0.0, 15.0),
    },
    {"chest": (37.0, 10.0, -2.0), "weight": 0.38, "blade": (80.0, 0.0, 80.0)},
)

# The backhand: coiled over the shield arm, then level from the left to the right.
RIGHTWARD = _stroke(
    GUARD.but(
        height=0.755,
        weight=0.36,
        hips=(2.0, 6.0, 0.0),
        chest=(20.0, 10.0, -2.0),
        gaze=(-4.0, 0.0),
        hand=(0.24, 0.14, 0.02),
        blade=(130.0, 30.0, -50.0),
        shield=(0.12, 0.36, -0.26),
        face=(70.0, 0.0, 20.0),
    ),
    {"weight": 0.42, "hips": (-6.0, 6.0, 0.0), "chest": (10.0, 9.0, -1.0)},
    GUARD.but(
        height=0.745,
        weight=0.52,
        hips=(-18.0, 5.0, 0.0),
        chest=(-20.0, 8.0, 0.0),
        hand=(0.46, -0.26, -0.10),
        blade=(8.0, 2.0, -80.0),
        shield=(0.22, 0.28, -0.20),
        face=(42.0, 0.0, 28.0),
    ),
    {
        "weight": 0.60,
        "hips": (-24.0, 4.0, 0.0),
        "chest": (-44.0, 6.0, 2.0),
        "gaze": (4.0, 0.0),
        "hand": (0.22, -0.56, -0.12),
        "blade": (-78.0, 2.0, -75.0),
        "shield": (0.34, 0.12, -0.14),
        "face": (10.0, 0.0, 32.0),
    },
    {"chest": (-47.0, 6.0, 2.0), "blade": (-86.0, 0.0, -70.0)},
)

# From over the left shoulder down to the right knee.
DOWN_RIGHT = _stroke(
    GUARD.but(
        height=0.780,
        weight=0.38,
        hips=(2.0, 3.0, 0.0),
        chest=(20.0, 1.0, -3.0),
        gaze=(-4.0, 0.0),
        hand=(0.24, 0.10, 0.09),
        blade=(135.0, 50.0, -45.0),
        shield=(0.10, 0.36, -0.26),
        face=(72.0, 0.0, 20.0),
    ),
    {"weight": 0.44, "hips": (-6.0, 4.0, 0.0), "chest": (10.0, 4.0, -2.0)},
    GUARD.but(
        height=0.750,
        weight=0.46,
        hips=(-16.0, 6.0, 0.0),
        chest=(-18.0, 12.0, 2.0),
        hand=(0.46, -0.22, -0.08),
        blade=(8.0, 6.0, -55.0),
        shield=(0.22, 0.28, -0.20),
        face=(42.0, 0.0, 28.0),
    ),
    {
        "height": 0.735,
        "weight": 0.56,
        "hips": (-24.0, 6.0, 2.0),
        "chest": (-46.0, 17.0, 8.0),
        "gaze": (4.0, 0.0),
        "hand": (0.14, -0.52, -0.38),
        "blade": (-78.0, -30.0, -50.0),
        "shield": (0.34, 0.12, -0.12),
        "face": (8.0, 0.0, 32.0),
    },
    {"chest": (-50.0, 17.0, 9.0), "hand": (0.06, -0.52, -0.40), "blade": (-92.0, -32.0, -30.0)},
)

# The way back along the same line: from the right knee up over the left shoulder.
UP_LEFT = _stroke(
    UP.wound.but(hand=(-0.10, -0.46, -0.38), blade=(-105.0, -28.0, 80.0)),
    {"weight": 0.52, "hips": (-20.0, 7.0, 2.0), "chest": (-42.0, 14.0, 7.0), "hand": (-0.02, -0.48, -0.40)},
    UP.midway.but(hand=(0.44, -0.21, -0.22), blade=(-20.0, -2.0, 118.0)),
    {
        "height": 0.780,
        "weight": 0.34,
        "hips": (8.0, 3.0, 0.0),
        "chest": (30.0, 0.0, -4.0),
        "hand": (0.36, 0.10, 0.08),
        "blade": (68.0, 42.0, 120.0),
        "shield": (0.02, 0.36, -0.28),
        "face": (84.0, 0.0, 12.0),
    },
    {"chest": (33.0, -1.0, -4.0), "blade": (80.0, 48.0, 115.0)},
    pace=1.2,
)
