"""Reading recordings of any known format: a file, a folder of them, or a dataset that lists them."""

import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.dataset import SUFFIXES, read_dataset
from murmillo.envs.motion.formats.amass import read_amass
from murmillo.envs.motion.formats.amc import read_amc
from murmillo.envs.motion.formats.bvh import read_bvh
from murmillo.envs.motion.formats.conventions import clip_name
from murmillo.envs.motion.formats.deepmimic import read_deepmimic
from murmillo.envs.motion.formats.iccgan import read_iccgan
from murmillo.envs.motion.formats.options import ReadOptions
from murmillo.envs.motion.formats.poselib import read_poselib_recording
from murmillo.envs.motion.formats.provenance import find_provenance
from murmillo.envs.motion.formats.recording import Recording
from murmillo.envs.motion.reading import read_bytes

READERS: dict[str, Callable[[bytes, Path, ReadOptions], Recording]] = {
    ".amc": read_amc,
    ".bvh": read_bvh,
    ".json": read_iccgan,
    ".npy": read_poselib_recording,
    ".npz": read_amass,
    ".txt": read_deepmimic,
}
"""By suffix. An .asf is read with the .amc beside it."""
_NO_MOTIONS = ("readme", "license", "licence", "copying", "notice", "changelog", "manifest", "labels")


@dataclass(frozen=True)
class ListedFile:
    """A file to read.

    Attributes:
        name: that its recording is to have where others of the same stem are listed; None: its own.
        weight: sampling weight in the dataset that lists it; None: not given.
    """

    path: Path
    name: str | None = None
    weight: float | None = None


def iter_files(path: str | Path) -> Iterator[ListedFile]:
    """The files of motions that a path stands for: itself, those in a folder and deeper, or those that a dataset lists.

    Raises:
        MotionError: nothing there, no file of a known format, or a dataset that cannot be read.
    """
    path = Path(path)
    if not os.path.exists(path):  # Path.exists raises for a name that no file can have
        raise MotionError(f"{path}: there is no such file or folder; give the path of motions")
    if path.is_dir():
        files = _walk(path)
        if not files:
            raise MotionError(f"{path}: holds no motions; known are {', '.join(READERS)}")
        yield from _named([ListedFile(file) for file in files], path)
    elif path.suffix.lower() in SUFFIXES:
        listed = [ListedFile(file, weight=weight) for file, weight in read_dataset(path).items()]
        yield from _named(listed, path.parent)
    else:
        yield ListedFile(path)


def read_file(file: str | Path | ListedFile, options: ReadOptions | None = None) -> Recording:
    """The recording in a file, by the format that its suffix says.

    A file without a licence of its own has that of its folder, where `find_provenance` finds one.

    Raises:
        MotionError: missing, of an unknown format, damaged, or asking for code to be run; in one printable line.
    """
    listed = file if isinstance(file, ListedFile) else ListedFile(Path(file))
    try:
        recording = _read(listed.path, options or ReadOptions())
    except MotionError as error:  # names of files may have anything in them
        raise MotionError("".join(char if char.isprintable() else "?" for char in str(error))) from None
    return replace(
        recording,
        name=listed.name or recording.name,
        weight=recording.weight if listed.weight is None else listed.weight,
    )


def read_recordings(path: str | Path, options: ReadOptions | None = None) -> tuple[list[Recording], list[str]]:
    """All sound recordings of a file, a folder or a dataset, and for each other file one line that says what is wrong.

    Raises:
        MotionError: there is nothing to read, see `iter_files`.
    """
    recordings, problems = [], []
    for file in iter_files(path):
        try:
            recordings.append(read_file(file, options))
        except MotionError as error:
            problems.append(str(error))
    return recordings, problems


def _read(file: Path, options: ReadOptions) -> Recording:
    suffix = file.suffix.lower()
    if suffix == ".asf":
        raise MotionError(f"{file}: is a skeleton without motion; give the .amc files beside it")
    if suffix not in READERS:
        raise MotionError(f"{file}: files of type {suffix or '(none)'} are unknown; known are {', '.join(READERS)}")
    if not os.path.isfile(file):  # a pipe would be waited for; Path.is_file raises for names that no file can have
        raise MotionError(f"{file}: is no file; check the path")
    recording = READERS[suffix](read_bytes(file), file, options)
    if recording.licence != "unknown":
        return recording
    found = find_provenance(file.parent)
    return replace(recording, source=found.source, licence=found.licence, redistributable=found.redistributable)


def _walk(folder: Path) -> list[Path]:
    """The motions in a folder and in those below; links to folders are not followed."""
    files = [Path(place, name) for place, _, names in os.walk(folder) for name in names]
    return sorted(file for file in files if file.suffix.lower() in READERS and file.stem.lower() not in _NO_MOTIONS)


def _named(files: list[ListedFile], folder: Path) -> Iterator[ListedFile]:
    """The files; those that share a stem are named after their folders and suffixes, for clips' names are unique."""
    stems = Counter(clip_name(file.path).lower() for file in files)
    for file in files:
        if stems[clip_name(file.path).lower()] > 1:
            parts = file.path.relative_to(folder).parts
            file = replace(file, name=clip_name(Path("_".join(parts).replace(".", "_"))))
        yield file
