"""From key poses and steps to a whole-body motion: 30 frames a second, planted feet, a centre of mass that balances."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.ndimage import maximum_filter1d
from scipy.spatial.transform import Rotation

from murmillo.envs.character import Character
from murmillo.envs.motion.authored.body import FootTargets, Pose, Puppet
from murmillo.envs.motion.authored.feet import FootPath, Place, Step, foot_path
from murmillo.envs.motion.authored.timing import FPS, centre_of_mass, free_fall, load_of, ramp, smooth, through_keys

STANCE = {"left": Place(0.20, 0.12, 4.0), "right": Place(-0.22, -0.12, -38.0)}
COM_HEIGHT = 0.90  # [m]
REACH = 0.816  # from hip to ankle with the knee bent by 22 degrees [m]
HIP_OFFSET = {"left": 0.084887, "right": -0.084887}  # of the hip joints from the pelvis, to the left [m]
FLIGHT_PASSES = 2
# The trunk leads, the limbs follow: successive breaking of joints [s].
LAG = {"neck": -0.03, "right_shoulder": 0.02, "right_elbow": 0.04, "right_wrist": 0.06, "left_elbow": 0.02}


@dataclass(frozen=True)
class Key:
    """A pose at a time [s], told in a frame that has turned by `heading` [deg]."""

    time: float
    pose: Pose
    heading: float = 0.0


@dataclass(frozen=True)
class Take:
    """One skill as its author writes it.

    `sway` is how slowly the load passes from foot to foot [s]; `whip` is the share of the limbs' lags: a cut is
    whipped (1), a thrust goes straight (0).
    """

    label: str
    keys: Sequence[Key]
    steps: Sequence[Step] = ()
    sway: float = 0.06
    whip: float = 1.0
    loop: bool = False


def perform(take: Take, puppet: Puppet, character: Character) -> np.ndarray:
    """The take as qpos [F, nq] at 30 frames a second; the last key is the last frame."""
    time = np.arange(round(take.keys[-1].time * FPS) + 1) / FPS
    key_times = np.array([key.time for key in take.keys])
    feet = {side: foot_path(side, place, take.steps, time) for side, place in STANCE.items()}
    hips = np.array([[key.pose.hips[0] + key.heading, *key.pose.hips[1:], key.pose.height] for key in take.keys])
    hips = through_keys(key_times, hips, time)
    airborne = ~(feet["left"].planted | feet["right"].planted)
    if airborne.any():
        hips[:, 3] = free_fall(hips[:, 3], airborne, FPS)
    support = _support(take, feet, time, load_of(hips[:, 3], FPS) if airborne.any() else None)

    key_qpos = []
    for key in take.keys:
        frame = round(key.time * FPS)
        key_qpos.append(puppet.pose(key.pose, _at(feet, frame), support[frame], key.heading))
    coordinates = character.joint_coordinates(torch.from_numpy(np.stack(key_qpos))).numpy()
    joints = _interpolate(coordinates, key_times, time, character, take.whip)
    rotation = Rotation.from_euler("ZYX", hips[:, :3], degrees=True)

    pelvis = np.column_stack([support, hips[:, 3]])
    qpos = _follow(puppet, character, joints, feet, pelvis, rotation, key_qpos[0], support)
    # The first solution balances; in the second the pelvis keeps its way but rides smoothly, and legs do not overreach.
    pelvis[:, :2] = support + smooth(qpos[:, :2] - support, take.sway, FPS)
    pelvis[:, 2] -= _overreach(pelvis, rotation, feet)
    joints = smooth(character.joint_coordinates(torch.from_numpy(qpos)).numpy(), 0.02, FPS)
    if not airborne.any():
        return _follow(puppet, character, joints, feet, pelvis, rotation, key_qpos[0])
    height = free_fall(puppet.centres_of_mass(qpos)[:, 2], airborne, FPS)
    for _ in range(FLIGHT_PASSES):  # the limbs move in the air, and the pelvis against them
        qpos = _follow(puppet, character, joints, feet, pelvis, rotation, key_qpos[0])
        pelvis[:, 2] += height - puppet.centres_of_mass(qpos)[:, 2]
    return _follow(puppet, character, joints, feet, pelvis, rotation, key_qpos[0])


def _overreach(pelvis: np.ndarray, rotation: Rotation, feet: dict[str, FootPath]) -> np.ndarray:
    """How much the pelvis [F, 3] must sink [F] [m] so that no leg is stretched beyond `REACH`: in time and smoothly."""
    excess = np.zeros(len(pelvis))
    for side, path in feet.items():
        hip = rotation.apply([0.0, HIP_OFFSET[side], 0.0]) + pelvis
        across = np.linalg.norm(path.ankle[:, :2] - hip[:, :2], axis=1)
        highest = path.ankle[:, 2] + np.sqrt(np.maximum(REACH**2 - across**2, 0.0))
        excess = np.maximum(excess, hip[:, 2] - highest)
    spread = maximum_filter1d(excess, round(0.27 * FPS), mode="nearest")
    return smooth(spread, 0.06, FPS)


def _support(take: Take, feet: dict[str, FootPath], time: np.ndarray, load: np.ndarray | None) -> np.ndarray:
    """Ground point under the centre of mass [F, 2], from the share of the load [F] that each foot carries."""
    key_times = np.array([key.time for key in take.keys])
    weight = through_keys(key_times, np.array([[key.pose.weight] for key in take.keys]), time)[:, 0]
    weight = np.where(feet["right"].planted, weight, 0.0)
    weight = np.where(feet["left"].planted, weight, 1.0)
    weight = smooth(weight, take.sway, FPS)[:, None]
    pressure = (1.0 - weight) * feet["left"].centre + weight * feet["right"].centre
    pressure = smooth(pressure, take.sway, FPS)
    if take.loop:  # solved with a turn before and a turn after
        turns = np.concatenate([pressure[:-1], pressure[:-1], pressure])
        return centre_of_mass(turns, COM_HEIGHT, FPS)[len(pressure) - 1 :][: len(pressure)]
    return centre_of_mass(pressure, COM_HEIGHT, FPS, load)


def _interpolate(
    coordinates: np.ndarray, key_times: np.ndarray, time: np.ndarray, character: Character, whip: float
) -> np.ndarray:
    """Key coordinates [K, A] to every frame [F, A], each joint with its share of its lag; exact at both ends."""
    result = np.empty((len(time), coordinates.shape[1]))
    inside = ramp(time, 0.0, 0.3) * (1.0 - ramp(time, time[-1] - 0.3, time[-1]))
    for joint in character.joints:
        when = time - whip * LAG.get(joint.name, 0.0) * inside
        result[:, joint.action] = through_keys(key_times, coordinates[:, joint.action], when)
    return result


def _follow(
    puppet: Puppet,
    character: Character,
    joints: np.ndarray,
    feet: dict[str, FootPath],
    pelvis: np.ndarray,
    rotation: Rotation,
    start: np.ndarray,
    support: np.ndarray | None = None,
) -> np.ndarray:
    """Every frame solved in turn, [F, nq]; balanced over `support` where it is given."""
    puppet.start_from(start)
    wishes = (joints, pelvis, rotation.as_quat(scalar_first=True))
    wished = character.pose(*(torch.from_numpy(wish) for wish in wishes)).numpy()
    return np.stack(
        [
            puppet.follow(wished[i], _at(feet, i), pelvis[i], rotation[i], None if support is None else support[i])
            for i in range(len(joints))
        ]
    )


def _at(feet: dict[str, FootPath], frame: int) -> FootTargets:
    return {side: (path.ankle[frame], path.rotation[frame]) for side, path in feet.items()}
