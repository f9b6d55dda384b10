"""Reader of BVH files (Biovision hierarchy): any channels in any order on any joint.

A joint's rotation is the product of its rotation channels from left to right; position channels replace the OFFSET.
Format: Meredith and Maddock, "Motion capture file formats explained", 2001.
"""

import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.conventions import settle
from murmillo.envs.motion.formats.options import ReadOptions, is_rate
from murmillo.envs.motion.formats.quaternions import about_axes, multiply, rotate
from murmillo.envs.motion.formats.raw_motion import RawMotion, check_size, rate_of
from murmillo.envs.motion.formats.recording import Recording, Skeleton
from murmillo.envs.motion.formats.table import read_table

_Floats = NDArray[np.float64]

_MAX_HEADER = 2**20
_MAX_JOINTS = 1000
_MAX_WORDS = 8
_BLANK_LINES = 1000
"""As many may stand between the frames."""
_MOTION = re.compile(rb"^[ \t]*MOTION[ \t\r]*$", re.MULTILINE | re.IGNORECASE)
_TIMING = re.compile(
    rb"\s*Frames\s*:\s*(?P<frames>\d{1,9})\s+Frame\s+Time\s*:\s*(?P<time>[-+.\w]{1,40})[ \t\r]*(?:\n|$)", re.IGNORECASE
)
_CHANNEL = re.compile(r"([XYZ])(position|rotation)", re.IGNORECASE)


@dataclass
class _Joint:
    """A node of the hierarchy; channels are (axis, whether it is a rotation) and `first` its first column."""

    name: str
    parent: int
    offset: _Floats = field(default_factory=lambda: np.zeros(3))
    channels: list[tuple[int, bool]] = field(default_factory=list)
    first: int = 0
    is_end: bool = False


def read_bvh(data: bytes, file: Path, options: ReadOptions) -> Recording:
    """The recording in the bytes of a BVH file.

    A root above the joint that moves (such as Bandai Namco's joint_Root above Hips) is folded into that joint. Other
    joints with position channels keep the mean of these as offset; findings say where they change.

    Raises:
        MotionError: a broken hierarchy, channels and numbers that do not match, or numbers that no motion has.
    """
    motion = _MOTION.search(data, 0, _MAX_HEADER)
    if motion is None:
        raise MotionError(f"{file}: has no line MOTION and so is no BVH file, or is cut short; export it anew")
    header = data[: motion.start()].decode("utf-8", errors="replace").removeprefix("\ufeff")
    joints = _Parser(header, file).joints()
    timing = _TIMING.match(data, motion.end())
    if timing is None:
        raise MotionError(f"{file}: lacks Frames: and Frame Time: after MOTION; export it anew")
    fps = _fps(timing["time"].decode("latin-1"), file) if options.fps is None else options.fps
    values = _read_values(data, timing.end(), int(timing["frames"]), joints, file)
    return settle(_assemble(joints, values, fps), file, options)


class _Parser:
    """Reads the tokens of a HIERARCHY; `_line` is where it is."""

    def __init__(self, header: str, file: Path) -> None:
        self._file = file
        self._tokens = iter([(t, n) for n, line in enumerate(header.split("\n"), 1) for t in line.split()])
        self._line = 1

    def joints(self) -> list[_Joint]:
        """All joints and end sites, parents first."""
        if self._take().upper() != "HIERARCHY" or self._take().upper() != "ROOT":
            raise self._error("does not begin with HIERARCHY and ROOT; export it anew")
        joints: list[_Joint] = []
        self._open(joints, -1, self._name())
        at = 0
        while at >= 0:
            token = self._take()
            match token.upper():
                case "OFFSET":
                    joints[at].offset = np.array([self._number() for _ in range(3)])
                case "CHANNELS" if not joints[at].is_end:
                    joints[at].channels = self._channels()
                case "JOINT" if not joints[at].is_end:
                    at = self._open(joints, at, self._name())
                case "END" if not joints[at].is_end:
                    self._name()
                    at = self._open(joints, at, f"{joints[at].name}_end")
                    joints[at].is_end = True
                case "}":
                    at = joints[at].parent
                case _:
                    raise self._error(f"{token[:40]!a} is not expected here; correct the hierarchy or export it anew")
        if next(self._tokens, None) is not None:
            raise self._error("there is more after the root's last }; keep one ROOT a file")
        names = [joint.name for joint in joints]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise MotionError(f"{self._file}: has two joints named {twice[:40]!a}; rename one")
        first = 0
        for joint in joints:
            joint.first = first
            first += len(joint.channels)
        return joints

    def _open(self, joints: list[_Joint], parent: int, name: str) -> int:
        if len(joints) >= _MAX_JOINTS:
            raise self._error(f"has more than {_MAX_JOINTS} joints; export the body only")
        joints.append(_Joint(name, parent))
        return len(joints) - 1

    def _name(self) -> str:
        """The words up to the brace that opens the block."""
        words, line = [], self._line
        while (word := self._take()) != "{":
            line = line if words else self._line
            words.append(word)
            if self._line != line or len(words) > _MAX_WORDS:
                self._line = line
                raise self._error("a joint has no { after its name; correct the hierarchy or export it anew")
        name = " ".join(words)
        if not (name and name.isprintable()):
            raise self._error("a joint has no name of printable text; correct the hierarchy or export it anew")
        return name

    def _channels(self) -> list[tuple[int, bool]]:
        count = self._number()
        if count not in range(7):
            raise self._error(f"CHANNELS {count:g}: a joint has 0 to 6; correct it or export it anew")
        channels = []
        for _ in range(int(count)):
            token = self._take()
            channel = _CHANNEL.fullmatch(token)
            if channel is None:
                raise self._error(f"CHANNELS {count:g}: has {token[:40]!a} in the place of a channel; export it anew")
            channels.append(("XYZ".index(channel[1].upper()), channel[2].lower() == "rotation"))
        positions = [axis for axis, turns in channels if not turns]
        if len(set(positions)) != len(positions):
            raise self._error("CHANNELS names a position twice; correct it or export it anew")
        return channels

    def _number(self) -> float:
        token = self._take()
        try:
            number = float(token)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise self._error(f"{token[:40]!a} is no number; correct it or export it anew")
        return number

    def _take(self) -> str:
        token, self._line = next(self._tokens, ("", self._line))
        if not token:
            raise self._error("the hierarchy ends before its last }; the file is cut short or a brace is missing")
        return token

    def _error(self, problem: str) -> MotionError:
        return MotionError(f"{self._file}: line {self._line}: {problem}")


def _fps(frame_time: str, file: Path) -> float:
    try:
        seconds = float(frame_time)
    except ValueError:
        seconds = math.nan
    if not (seconds > 0.0 and is_rate(1.0 / seconds)):
        raise MotionError(f"{file}: Frame Time is {frame_time!a}; write the seconds of a frame, or tell fps= (--fps)")
    return rate_of(seconds)


def _read_values(data: bytes, start: int, frames: int, joints: list[_Joint], file: Path) -> _Floats:
    """The numbers [F, C] of the MOTION part, angles in degrees."""
    channels = sum(len(joint.channels) for joint in joints)
    if frames == 0 or channels == 0:
        raise MotionError(f"{file}: has {frames} frames of {channels} channels and so no motion; export it anew")
    check_size(frames, len(joints), str(file))
    lines = [line for line in data[start:].split(b"\n", frames + _BLANK_LINES) if line and not line.isspace()]
    if len(lines) != frames:
        raise MotionError(
            f"{file}: says Frames: {frames} and has {len(lines)} lines of them; it is cut short or damaged"
        )
    return read_table(lines, channels, "frame", str(file))


def _assemble(joints: list[_Joint], values: _Floats, fps: float) -> RawMotion:
    radians = np.radians(values)
    quat = np.empty((len(values), len(joints), 4))
    place = {}
    for j, joint in enumerate(joints):
        columns = range(joint.first, joint.first + len(joint.channels))
        turns = [(axis, radians[:, c]) for c, (axis, turns) in zip(columns, joint.channels, strict=True) if turns]
        quat[:, j] = about_axes(turns)
        moves = [(axis, c) for c, (axis, turns) in zip(columns, joint.channels, strict=True) if not turns]
        if moves:
            place[j] = np.tile(joint.offset, (len(values), 1))
            for axis, column in moves:
                place[j][:, axis] = values[:, column]
    keep, root_pos = _fold_roots(joints, quat, place)
    keep = [j for j in keep if not joints[j].is_end or joints[j].offset.any()]
    offsets = np.stack([place[j].mean(axis=0) if j in place else joints[j].offset for j in keep])
    offsets[0] = 0.0
    skeleton = Skeleton(
        names=tuple(joints[j].name for j in keep),
        parents=(-1, *(keep.index(joints[j].parent) for j in keep[1:])),
        offsets=offsets,
    )
    drift = {
        joints[j].name: float(np.linalg.norm(place[j] - place[j].mean(axis=0), axis=1).max())
        for j in keep[1:]
        if j in place
    }
    raw = RawMotion(skeleton, root_pos, quat[:, keep], fps, drift=drift)
    if keep[0] == 0:
        return raw
    return replace(raw, findings={"root": f"{joints[keep[0]].name}; {joints[0].name} above it is folded in"})


def _fold_roots(joints: list[_Joint], quat: _Floats, place: dict[int, _Floats]) -> tuple[list[int], _Floats]:
    """The joints without those at the top that carry a moving one with most of the body; where the new root is [F, 3].

    The new root's `quat` becomes its rotation in the world.
    """
    keep = list(range(len(joints)))
    root_pos = place.get(0, np.tile(joints[0].offset, (len(quat), 1)))
    while True:
        root = keep[0]
        for child in (j for j in keep[1:] if joints[j].parent == root and j in place):
            branch = _branch(joints, child)
            if 2 * len(branch) > len(keep) and np.ptp(place[child], axis=0).max() > 1e-3 * np.abs(place[child]).max():
                root_pos = root_pos + rotate(quat[:, root], place[child])
                quat[:, child] = multiply(quat[:, root], quat[:, child])
                keep = branch
                break
        else:
            return keep, root_pos


def _branch(joints: list[_Joint], root: int) -> list[int]:
    branch = {root}
    for j in range(root + 1, len(joints)):
        if joints[j].parent in branch:
            branch.add(j)
    return sorted(branch)
