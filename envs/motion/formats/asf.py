"""Reader of Acclaim skeletons (.asf), which Acclaim motions (.amc) need.

A bone has a direction and a length in the world's axes at rest, and axes of its own (`axis`), about which it is turned.
Format: Lander, "Working with motion capture file formats", Game Developer, January 1998.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.quaternions import about_axes

_Floats = NDArray[np.float64]

_MAX_BYTES = 2**20
_MAX_BONES = 500
_LIMIT = 1e6
_DOF = ("tx", "ty", "tz", "rx", "ry", "rz", "l")
_INCH = 0.0254
ROOT = "root"


@dataclass(frozen=True, eq=False)
class Bone:
    """A bone, or the root.

    Attributes:
        parent: index of its parent, -1 for the root.
        span: [3] from its joint to its end, at rest, in the world's axes [file's unit].
        axes: [4] wxyz rotation of its own axes in the world, at rest.
        dof: what the numbers of the motion are, in order: tx, ty, tz, rx, ry, rz or l, a length.
    """

    name: str
    parent: int
    span: _Floats
    axes: _Floats
    dof: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class AcclaimSkeleton:
    """The skeleton of a subject.

    Attributes:
        bones: the root, then the bones, parents before their children.
        root_pos: [3] of the root at rest [file's unit].
        turn_order: the axes about which the root turns, the first one first, such as "xyz".
        unit: metres in the file's unit, which it gives as a part of an inch.
    """

    bones: tuple[Bone, ...]
    root_pos: _Floats
    turn_order: str
    unit: float


def find_asf(amc: Path) -> Path:
    """The skeleton beside a motion: of the same name, else of the subject that the name begins with, else the only one.

    Raises:
        MotionError: none, or several that could be meant.
    """
    try:
        found = sorted(file for file in amc.parent.iterdir() if file.suffix.lower() == ".asf" and file.is_file())
    except OSError as error:
        raise MotionError(f"{amc.parent}: cannot be read ({error.strerror or error}); check the path") from None
    if not found:
        raise MotionError(f"{amc}: has no skeleton beside it; put the subject's .asf into the same folder")
    subjects = [file for file in found if amc.stem == file.stem or amc.stem.startswith(f"{file.stem}_")]
    if subjects:
        return max(subjects, key=lambda file: len(file.stem))
    if len(found) == 1:
        return found[0]
    names = ", ".join(file.name for file in found[:5])
    raise MotionError(f"{amc}: which of {names} is its skeleton? name it like the motion, {amc.stem}.asf")


def read_asf(data: bytes, file: Path) -> AcclaimSkeleton:
    """The skeleton in the bytes of an .asf file.

    Raises:
        MotionError: no such file, a bone without a direction, or a broken hierarchy.
    """
    if len(data) > _MAX_BYTES:
        raise MotionError(f"{file}: is larger than {_MAX_BYTES // 2**20} MB and so is no skeleton; get the file anew")
    return _Parser(file).read(data.decode("utf-8", errors="replace"))


def euler(turns: Sequence[tuple[str, ArrayLike]]) -> _Floats:
    """The rotation [..., 4] by these turns (axis, angle [rad]) about the axes of the world, the first one first."""
    return about_axes([("xyz".index(axis), angle) for axis, angle in reversed(turns)])


class _Parser:
    """Goes through the lines, keeps what each section says, and makes bones of it; `_line` is where it is."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._line = 0
        self._units: dict[str, list[str]] = {}
        self._root: dict[str, list[str]] = {}
        self._bones: dict[str, dict[str, list[str]]] = {}
        self._bone: dict[str, list[str]] | None = None
        self._parents: dict[str, str] = {}

    def read(self, text: str) -> AcclaimSkeleton:
        section = ""
        for self._line, line in enumerate(text.split("\n"), 1):
            words = line.split("#", 1)[0].split()
            if not words:
                continue
            key, values = words[0].lower(), words[1:]
            match section:
                case _ if key.startswith(":"):
                    section = key
                case ":units":
                    self._units[key] = values
                case ":root":
                    self._root[key] = values
                case ":bonedata":
                    self._bone_line(key, values)
                case ":hierarchy" if key not in ("begin", "end"):
                    self._hierarchy_line(words)
        return self._skeleton()

    def _bone_line(self, key: str, values: list[str]) -> None:
        if key == "begin":
            self._bone = {}
        elif self._bone is None:
            raise self._error(f"{key[:40]!a} is outside of begin and end")
        elif key != "end":
            self._bone[key] = values
        else:
            name = " ".join(self._bone.get("name", []))
            if not (name and name.isprintable()) or name in (ROOT, *self._bones) or len(self._bones) >= _MAX_BONES:
                raise self._error(f"a bone named {name[:40]!a} is one too many, or not a name")
            self._bones[name], self._bone = self._bone, None

    def _hierarchy_line(self, words: list[str]) -> None:
        for name in words:
            if name != ROOT and name not in self._bones:
                raise self._error(f"the hierarchy names {name[:40]!a}, which :bonedata has not")
        for child in words[1:]:
            if child == ROOT or child in self._parents:
                raise self._error(f"the hierarchy gives {child[:40]!a} a second parent")
            self._parents[child] = words[0]

    def _skeleton(self) -> AcclaimSkeleton:
        if not self._bones:
            raise MotionError(f"{self._file}: has no :bonedata and so is no Acclaim skeleton; get the file anew")
        order = [ROOT]
        for name in order:  # grows as it goes
            order += [child for child, parent in self._parents.items() if parent == name]
        astray = next((name for name in self._bones if name not in order), None)
        if astray is not None:
            raise MotionError(f"{self._file}: {astray[:40]!a} does not hang from the root; correct its :hierarchy")
        (scale,) = self._numbers(self._units.get("length", ["1.0"]), 1, "length")
        if not scale > 0.0:
            raise MotionError(f"{self._file}: a length of {scale:g} is no unit; write the part of an inch that it is")
        root = Bone(
            ROOT,
            -1,
            np.zeros(3),
            self._axes([*self._root.get("orientation", ["0", "0", "0"]), *self._root.get("axis", [])], ROOT),
            self._dof(self._root.get("order", ["tx", "ty", "tz", "rx", "ry", "rz"]), ROOT),
        )
        return AcclaimSkeleton(
            (root, *(self._make_bone(name, order.index(self._parents[name])) for name in order[1:])),
            np.array(self._numbers(self._root.get("position", ["0", "0", "0"]), 3, ROOT)),
            self._order(self._root.get("axis", []), ROOT),
            _INCH / scale,
        )

    def _make_bone(self, name: str, parent: int) -> Bone:
        said = self._bones[name]
        direction = np.array(self._numbers(said.get("direction", []), 3, name))
        (length,) = self._numbers(said.get("length", []), 1, name)
        axes = self._axes(said.get("axis", ["0", "0", "0"]), name)
        return Bone(name, parent, length * direction, axes, self._dof(said.get("dof", []), name))

    def _axes(self, words: list[str], name: str) -> _Floats:
        angles = dict(zip("xyz", self._numbers(words[:3], 3, name), strict=True))
        in_radians = "".join(self._units.get("angle", [])).lower().startswith("rad")
        scale = 1.0 if in_radians else np.pi / 180.0
        return euler([(axis, scale * angles[axis]) for axis in self._order(words[3:], name)])

    def _order(self, words: list[str], name: str) -> str:
        order = "".join(words).lower() or "xyz"
        if sorted(order) != ["x", "y", "z"]:
            raise MotionError(f"{self._file}: {name}: {order[:20]!a} is no order of axes; write one such as XYZ")
        return order

    def _dof(self, words: list[str], name: str) -> tuple[str, ...]:
        dof = tuple(word.lower() for word in words)
        if len(set(dof)) != len(dof) or not set(dof) <= set(_DOF):
            raise MotionError(f"{self._file}: {name}: {' '.join(words)[:40]!a} are no dof; known are {', '.join(_DOF)}")
        return dof

    def _numbers(self, words: list[str], count: int, name: str) -> list[float]:
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            numbers = []
        if len(numbers) != count or not all(abs(number) < _LIMIT for number in numbers):
            raise MotionError(f"{self._file}: {name}: {' '.join(words)[:40]!a} are not {count} numbers; get it anew")
        return numbers

    def _error(self, problem: str) -> MotionError:
        return MotionError(f"{self._file}: line {self._line}: {problem}; correct it or get the file anew")
