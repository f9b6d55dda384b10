"""The 15-link humanoid that DeepMimic, AMP and ICCGAN share: which links it has and where their joints are."""

import numpy as np

from murmillo.envs.motion.formats.recording import Skeleton

_RIGHT_SHOULDER = (-0.02405, -0.18311, 0.24350)
_LEFT_SHOULDER = (-0.02405, 0.18311, 0.24350)
_UPPER_ARM = (0.0, 0.0, -0.274788)
_LOWER_ARM = (0.0, 0.0, -0.258947)
_THIGH = (0.0, 0.0, -0.421546)
_SHIN = (0.0, 0.0, -0.409870)

_LINKS = {
    # link: (DeepMimic's name of its joint, parent, joint in the parent's frame [m], x ahead, y left, z up)
    "pelvis": ("root", None, (0.0, 0.0, 0.0)),
    "torso": ("chest", "pelvis", (0.0, 0.0, 0.236151)),
    "head": ("neck", "torso", (0.0, 0.0, 0.223894)),
    "right_upper_arm": ("right_shoulder", "torso", _RIGHT_SHOULDER),
    "right_lower_arm": ("right_elbow", "right_upper_arm", _UPPER_ARM),
    "right_hand": ("right_wrist", "right_lower_arm", _LOWER_ARM),
    "left_upper_arm": ("left_shoulder", "torso", _LEFT_SHOULDER),
    "left_lower_arm": ("left_elbow", "left_upper_arm", _UPPER_ARM),
    "left_hand": ("left_wrist", "left_lower_arm", _LOWER_ARM),
    "right_thigh": ("right_hip", "pelvis", (0.0, -0.084887, 0.0)),
    "right_shin": ("right_knee", "right_thigh", _THIGH),
    "right_foot": ("right_ankle", "right_shin", _SHIN),
    "left_thigh": ("left_hip", "pelvis", (0.0, 0.084887, 0.0)),
    "left_shin": ("left_knee", "left_thigh", _THIGH),
    "left_foot": ("left_ankle", "left_shin", _SHIN),
}
"""Lengths of humanoid3d, the character of DeepMimic (Peng et al. 2018; MIT), which the later ones kept."""

_PARENTS = tuple(-1 if parent is None else list(_LINKS).index(parent) for _, parent, _ in _LINKS.values())
_OFFSETS = np.array([offset for _, _, offset in _LINKS.values()])

HUMANOID = Skeleton(tuple(_LINKS), _PARENTS, _OFFSETS)
"""With the links' names, in MJCF order."""

DEEPMIMIC = Skeleton(
    tuple(joint for joint, _, _ in _LINKS.values()), _PARENTS, _OFFSETS[:, [0, 2, 1]] * np.array([1.0, 1.0, -1.0])
)
"""With DeepMimic's joint names and axes: x ahead, y up, z right."""
