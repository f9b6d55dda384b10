"""What surrounds a blow: the short steps under it and the way that guard is taken again."""

from murmillo.envs.motion.authored.body import Pose
from murmillo.envs.motion.authored.feet import Place, Step
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT


def ahead(place: Place, x: float, y: float = 0.0, yaw: float = 0.0) -> Place:
    """The foothold moved forward by `x` and to the left by `y` [m], and turned by `yaw` [deg]."""
    return Place(place.x + x, place.y + y, place.yaw + yaw)


def step_in(start: float, end: float, place: Place) -> Step:
    """The leading foot shoots forward from `start` to `end` [s] and lands on the heel."""
    return Step("left", start, end, place, 0.04, push=6.0, strike=8.0, flat_time=0.06)


def step_home(start: float, end: float) -> Step:
    """The leading foot comes back to its place in guard."""
    return Step("left", start, end, LEFT, 0.038, push=9.0)


def recovered(weight: float) -> Pose:
    """Guard as it is first reached: the knees and the arms give a little before they settle."""
    return GUARD.but(
        height=0.756,
        weight=weight,
        chest=(-22.0, 8.0, 0.0),
        hand=(0.10, -0.30, -0.305),
        blade=(5.0, 26.0, 0.0),
        shield=(0.33, 0.09, -0.185),
    )
