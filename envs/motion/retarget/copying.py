"""Recordings of the character's own skeleton: their rotations are the clip's, to the bit."""

import numpy as np
from scipy.spatial.transform import Rotation

from murmillo.envs.motion.formats.recording import Recording
from murmillo.envs.motion.retarget.bases import Floats
from murmillo.envs.motion.retarget.figure import Figure

_SAME_PLACE = 0.005  # joints of equal skeletons are as near in their parents [m]
_LOST = 0.05  # a rotation that a hinge cannot have, or a body without a joint, may be lost up to this [rad]


def copied(recording: Recording, figure: Figure) -> Floats | None:
    """The poses [F, nq] of the recording, or None if its skeleton is not the character's own.

    It is if it has all the character's bodies, on the same parents and in the same places, and turns none about an axis
    that the character's joint has not.
    """
    character, skeleton = figure.character, recording.skeleton
    if not set(character.bodies) <= set(skeleton.names):
        return None
    order = [skeleton.names.index(body) for body in character.bodies]
    parents = [-1 if parent < 0 else order[parent] for parent in character.model.body_parentid[1:] - 1]
    if [skeleton.parents[joint] for joint in order] != parents:
        return None
    if np.abs(skeleton.offsets[order][1:] - character.model.body_pos[2:]).max() > _SAME_PLACE:
        return None
    qpos = np.empty((recording.frames, character.model.nq))
    qpos[:, :3], qpos[:, 3:7] = recording.root_pos_w, recording.quat[:, order[0]]
    joints = {int(character.model.joint(joint.name).bodyid[0]) - 1: joint for joint in character.joints}
    for body in range(1, len(order)):
        joint, quat = joints.get(body), recording.quat[:, order[body]]
        if joint is not None and joint.kind == "ball":
            qpos[:, joint.qpos] = quat
            continue
        turn = Rotation.from_quat(quat, scalar_first=True).as_rotvec()
        axis = np.zeros(3) if joint is None else character.model.joint(joint.name).axis
        along = turn @ axis
        if np.abs(turn - along[:, None] * axis).max() > _LOST:
            return None
        if joint is not None:
            qpos[:, joint.qpos.start] = along
    return qpos
