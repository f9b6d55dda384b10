"""How the sword is held where the recording knows of none."""

import numpy as np
from scipy.spatial.transform import Rotation

from murmillo.envs.motion.retarget.bases import Floats
from murmillo.envs.motion.retarget.figure import Figure

_RESTING = np.radians(10.0)  # how far a relaxed wrist lets the blade sink from a right angle to the forearm
_REACH = np.radians(35.0)  # how far the wrist turns from there to point the blade ahead
_ELEVATION = np.radians(20.0)  # of the direction that the blade is turned to


def grip(qpos: Floats, figure: Figure) -> Floats:
    """The poses [F, nq] with the blade pointing ahead and slightly up, as far as a wrist does that without effort.

    The wrist turns in proportion to what the blade's direction would gain by it, and so never leaps.
    """
    wrist = figure.joints.get("right_wrist")
    if wrist is None:
        return qpos
    _, quat = figure.forward_kinematics(qpos)
    forearm = Rotation.from_quat(quat[:, figure.body("right_lower_arm")], scalar_first=True)
    trunk = Rotation.from_quat(quat[:, figure.body("torso")], scalar_first=True)
    # the trunk's heading; its left stays level longer than its front when the body bends
    side = trunk.apply([0.0, 1.0, 0.0])
    heading = np.arctan2(-side[:, 0], side[:, 1])
    ahead = np.cos(_ELEVATION) * np.stack([np.cos(heading), np.sin(heading), np.zeros(len(qpos))], -1)
    ahead[:, 2] = np.sin(_ELEVATION)
    resting = forearm * Rotation.from_rotvec([0.0, _RESTING, 0.0])
    down = -np.sum(ahead * resting.apply([0.0, 0.0, 1.0]), axis=1)
    left = np.sum(ahead * resting.apply([0.0, 1.0, 0.0]), axis=1)
    turn = np.stack([np.zeros(len(qpos)), _RESTING + _REACH * down, _REACH * left], axis=-1)
    held = qpos.copy()
    held[:, wrist.qpos] = Rotation.from_rotvec(turn).as_quat(scalar_first=True)
    return held
