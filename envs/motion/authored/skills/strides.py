"""What walks and runs share: rows of footfalls straight ahead or back, and the way home into guard."""

from collections.abc import Sequence

import numpy as np

from murmillo.envs.motion.authored.feet import Place
from murmillo.envs.motion.authored.gait import Footfall, Swing
from murmillo.envs.motion.authored.skills.footwork import ahead
from murmillo.envs.motion.authored.skills.guard_pose import GUARD, LEFT, RIGHT
from murmillo.envs.motion.authored.take import Key

# Upright at ease, sword and shield low.
CARRIED = GUARD.but(
    height=0.808,
    hips=(-3.0, 3.0, 0.0),
    chest=(-10.0, 1.0, 0.0),
    hand=(0.03, -0.30, -0.35),
    blade=(4.0, 24.0, 0.0),
    shield=(0.26, 0.16, -0.24),
    face=(22.0, 0.0, 25.0),
)
SETTLING = Swing(lift=0.04, push=20.0, push_time=0.18)


def straight(
    lengths: Sequence[float],
    *,
    first: float,
    beat: float | np.ndarray,
    swing: Swing | Sequence[Swing],
    flight: float | np.ndarray,
    width: float = 0.075,
    toe_out: float = 6.5,
) -> list[Footfall]:
    """Alternate footfalls straight ahead, the right foot first, which lands at `first` [s].

    Args:
        lengths: of the steps [m], negative for backwards.
        beat: [s] from footfall to footfall; one for all or one for each.
        swing, flight: of `Footfall`; one for all or one for each.
        width: of each foot from the line [m].
        toe_out: yaw of the feet [deg].
    """
    count = len(lengths)
    beats = np.broadcast_to(beat, count)
    times = first + np.cumsum(beats) - beats[0]
    flights = np.broadcast_to(flight, count)
    swings = [swing] * count if isinstance(swing, Swing) else swing
    # each step is measured from the foot that stands ahead; backwards, from the one that stands behind
    x = (LEFT.x if lengths[0] > 0.0 else RIGHT.x) + np.cumsum(lengths)
    falls = []
    for i in range(count):
        foot, side = ("right", -1.0) if i % 2 == 0 else ("left", 1.0)
        place = Place(float(x[i]), width * side, toe_out * side)
        falls.append(Footfall(foot, float(times[i]), place, float(flights[i]), swings[i]))
    return falls


def home(last: Footfall, *, beat: float, swing: Swing) -> list[Footfall]:
    """Two more steps, right and left, into the stance of guard, from a last footfall of the left foot."""
    x = last.place.x + (0.27 if last.place.x > 0.0 else -0.30) - RIGHT.x
    return [
        Footfall("right", last.time + beat, ahead(RIGHT, x), swing=swing),
        Footfall("left", last.time + 2.0 * beat + 0.05, ahead(LEFT, x), swing=swing),
    ]


def settled(landed: float) -> list[Key]:
    """The knees give as the last foot lands [s], then guard."""
    given = GUARD.but(height=0.748, weight=0.45, chest=(-23.0, 8.0, 0.0), hand=(0.10, -0.30, -0.30))
    return [Key(landed + 0.12, given), Key(landed + 0.62, GUARD), Key(landed + 0.85, GUARD)]
