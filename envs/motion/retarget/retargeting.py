"""Retargeting: a recording of anybody becomes a clip of the character."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from murmillo.envs.character import Character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip, check_clip
from murmillo.envs.motion.formats.quaternions import slerp
from murmillo.envs.motion.formats.recording import Recording
from murmillo.envs.motion.ground import ground_of
from murmillo.envs.motion.retarget.anatomy import understand
from murmillo.envs.motion.retarget.bases import Floats
from murmillo.envs.motion.retarget.copying import copied
from murmillo.envs.motion.retarget.figure import Figure
from murmillo.envs.motion.retarget.finishing import calmed, lifted
from murmillo.envs.motion.retarget.fit import Fit, copied_fit, fit_of
from murmillo.envs.motion.retarget.grip import grip
from murmillo.envs.motion.retarget.pose import make_wish
from murmillo.envs.motion.retarget.skeleton_map import SkeletonMap, choose_map, load_map, locate
from murmillo.envs.motion.retarget.solve import Solver

FPS = 30.0


def retarget(
    recording: Recording,
    character: Character,
    skeleton_map: SkeletonMap | Path | None = None,
    fps: float | None = FPS,
) -> tuple[Clip, Fit]:
    """Make a clip of the character from a recording of any human skeleton.

    Where the skeleton is the character's own, rotations are copied. Otherwise the character's bones take the directions
    of the recording's, sizes are fitted by the length of the legs, feet that stand are held still, and inverse
    kinematics keeps the joints' bounds and the ground. A sword and a shield that the recording has not are posed, and
    named in `Clip.masked`.

    Args:
        skeleton_map: which joint is which point of the body, or a YAML file that says so; None: the shipped map that
            fits.
        fps: rate of the clip [Hz] if the recording's is higher; None keeps the recording's.

    Raises:
        MotionError: joint names that no map knows, a map that does not fit, or a recording too short for a clip.
    """
    recording = recording if fps is None else resampled(recording, fps)
    if recording.frames < 2:
        raise MotionError(f"{recording.name}: {recording.frames} frame at {recording.fps:g} Hz; a clip needs 2 or more")
    figure = Figure(character)
    if skeleton_map is None and (qpos := copied(recording, figure)) is not None:
        clip = _clip(recording, qpos, figure, masked=())
        return clip, copied_fit(clip, figure)
    if isinstance(skeleton_map, Path):
        skeleton_map = load_map(skeleton_map)
    chosen = skeleton_map or choose_map(recording.skeleton, recording.name)
    body = understand(recording, locate(chosen, recording.skeleton, recording.name), figure.waist)
    wish = make_wish(body, figure, recording.fps)
    wish = replace(wish, qpos=grip(wish.qpos, figure), unplanted=grip(wish.unplanted, figure))
    before = _clip(recording, wish.unplanted, figure, figure.masked)
    solved = calmed(Solver(figure).solve(wish, recording.name), figure, recording.fps)
    lowest = ground_of(_clip(recording, solved, figure, figure.masked), character).height.min(axis=1)
    after = _clip(recording, lifted(solved, lowest, recording.fps), figure, figure.masked)
    return after, fit_of(before, after, wish, figure, chosen.name)


def resampled(recording: Recording, fps: float) -> Recording:
    """The recording at this rate [Hz]; one that is hardly faster (below 2 %), or slower, stays as it is."""
    if recording.fps < 1.02 * fps or recording.frames < 2:
        return recording
    when = np.arange(0.0, recording.frames - 1 + 1e-6, recording.fps / fps)
    low = np.minimum(when.astype(int), recording.frames - 2)
    part = when - low
    root, quat = recording.root_pos_w, recording.quat
    return replace(
        recording,
        fps=fps,
        root_pos_w=root[low] + part[:, None] * (root[low + 1] - root[low]),
        quat=slerp(quat[low], quat[low + 1], part[:, None]),
    )


def _clip(recording: Recording, qpos: Floats, figure: Figure, masked: tuple[str, ...]) -> Clip:
    clip = Clip(
        name=recording.name,
        character=figure.character.name,
        fps=recording.fps,
        qpos=qpos,
        label=recording.name,
        source=recording.source,
        licence=recording.licence,
        redistributable=recording.redistributable,
        weight=recording.weight,
        loop=recording.loop,
        masked=masked,
    )
    return check_clip(clip, figure.character)
