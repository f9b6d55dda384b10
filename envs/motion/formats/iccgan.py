"""Reader of the JSON clips of ICCGAN, CompositeMotion and AdaptNet, for the 15-link humanoid.

`fps`, and `frames`: a map each, "pelvis": [position [m], rotation], the other links their rotation in the parent's
frame, all xyzw, z up. A link that a frame leaves out keeps the rotation of rest.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.conventions import settle
from murmillo.envs.motion.formats.humanoid import HUMANOID
from murmillo.envs.motion.formats.json_data import number_rows, read_json
from murmillo.envs.motion.formats.options import ReadOptions
from murmillo.envs.motion.formats.raw_motion import RawMotion, check_size
from murmillo.envs.motion.formats.recording import Recording

_ROOT = HUMANOID.names[0]
_REST = [0.0, 0.0, 0.0, 1.0]


def read_iccgan(data: bytes, file: Path, options: ReadOptions) -> Recording:
    """The recording in the bytes of a JSON clip.

    Raises:
        MotionError: no such clip, links that the humanoid has not, or numbers that are no pose.
    """
    content = read_json(data, str(file))
    frames, fps = content.get("frames"), content.get("fps")
    if not (isinstance(frames, list) and all(isinstance(frame, dict) for frame in frames)):
        raise MotionError(f"{file}: has no list of maps, frames, and so is no ICCGAN clip; get the file anew")
    if options.fps is None and type(fps) not in (int, float):
        raise MotionError(f"{file}: fps is missing; tell the recording's frames a second with fps= (--fps)")
    check_size(len(frames), len(HUMANOID.names), str(file))
    given = {link for frame in frames for link in frame}
    foreign = sorted(given - set(HUMANOID.names))
    if foreign:
        raise MotionError(
            f"{file}: has the link {foreign[0][:40]!a}; known are {', '.join(HUMANOID.names)}: rename or remove it"
        )
    root = [_root(frame, i, file) for i, frame in enumerate(frames)]
    root_pos = number_rows([pos for pos, _ in root], 3, "position of the pelvis in frame", str(file))
    quat = np.stack(
        [
            _wxyz([rotation for _, rotation in root], _ROOT, file),
            *(_wxyz([frame.get(link, _REST) for frame in frames], link, file) for link in HUMANOID.names[1:]),
        ],
        axis=1,
    )
    missing = [link for link in HUMANOID.names if link not in given]
    findings = {"links left out": f"{', '.join(missing)}; at rest"} if missing else {}
    rate = options.fps if options.fps is not None else _rate(fps)
    raw = RawMotion(HUMANOID, root_pos, quat, rate, up="z", unit=1.0, findings=findings)
    return settle(raw, file, options)


def _root(frame: dict[str, Any], index: int, file: Path) -> tuple[Any, Any]:
    pose = frame.get(_ROOT)
    if not (isinstance(pose, list) and len(pose) == 2):
        raise MotionError(f"{file}: frame {index}: {_ROOT} is not [position, rotation]; get the file anew")
    return pose[0], pose[1]


def _wxyz(rotations: list[Any], link: str, file: Path) -> NDArray[np.float64]:
    return np.roll(number_rows(rotations, 4, f"rotation of {link} in frame", str(file)), 1, axis=1)


def _rate(fps: Any) -> float:
    """As a float; a whole number of hundreds of digits becomes infinite, and is refused like that."""
    try:
        return float(fps)
    except OverflowError:
        return float("inf")
