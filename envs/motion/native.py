"""The project's own clip format: a folder with manifest.json and one .npz a clip, that holds numbers and nothing else.

Each .npz has one uncompressed array, `qpos` [F, nq] float64. The same clips give the same bytes on every machine.
"""

import hashlib
import io
import re
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.character import Character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip, check_clip
from murmillo.envs.motion.formats.npy import read_float_array
from murmillo.envs.motion.manifest import MANIFEST, entry_of, read_manifest, write_manifest
from murmillo.envs.motion.reading import read_bytes

_MEMBER = "qpos.npy"


def save_clips(folder: str | Path, clips: Sequence[Clip]) -> None:
    """Write the clips as one folder, which appears whole or not at all; a folder of clips saved before is replaced.

    Raises:
        MotionError: no clips, clips of several characters, two of one name, or a folder that cannot be written or holds
            anything else than saved clips.
    """
    characters = sorted({clip.character for clip in clips})
    if not characters:
        raise MotionError(f"{folder}: there are no clips to save; give at least one")
    if len(characters) > 1:
        raise MotionError(f"{folder}: clips of several characters ({', '.join(characters)}); save each on its own")
    contents: dict[str, bytes] = {}
    entries = []
    for clip, file in zip(clips, _file_names(folder, clips), strict=True):
        contents[file] = _pack(clip.qpos)
        entries.append(entry_of(clip, file, hashlib.sha256(contents[file]).hexdigest()))
    contents[MANIFEST] = write_manifest(characters[0], entries)
    try:
        _replace_folder(Path(folder).absolute(), contents)
    except OSError as error:
        raise MotionError(f"{folder}: cannot be written ({error.strerror or error}); choose another folder") from None


def _file_names(folder: str | Path, clips: Sequence[Clip]) -> list[str]:
    """A plain name for the file of each clip; names that differ in foreign letters alone are told apart by numbers."""
    files: dict[str, str] = {}  # by the clip's name; some file systems do not tell upper from lower case
    for clip in clips:
        stem = re.sub(r"[^\w().-]", "_", clip.name, flags=re.ASCII)
        if clip.name.casefold() in files:
            raise MotionError(f"{folder}: two clips would be the file {stem}.npz; give each clip a name of its own")
        candidates = chain([f"{stem}.npz"], (f"{stem}-{number}.npz" for number in count(2)))
        taken = {file.lower() for file in files.values()}
        files[clip.name.casefold()] = next(file for file in candidates if file.lower() not in taken)
    return list(files.values())


def _pack(qpos: NDArray[np.float64]) -> bytes:
    """An .npz whose bytes depend on the numbers alone: not compressed, and dated to the zip format's first day."""
    array = io.BytesIO()
    np.lib.format.write_array(array, np.ascontiguousarray(qpos, dtype="<f8"), version=(1, 0), allow_pickle=False)
    member = zipfile.ZipInfo(_MEMBER, date_time=(1980, 1, 1, 0, 0, 0))
    member.create_system = 3
    member.external_attr = 0o644 << 16
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(member, array.getvalue())
    return packed.getvalue()


def check_destination(folder: str | Path) -> None:
    """Refuse, before work is done for it, a folder that `save_clips` could not write.

    Raises:
        MotionError: it cannot be written, or holds anything else than saved clips.
    """
    path = Path(folder).absolute()
    try:
        _refuse_foreign(path)
        nearest = next(parent for parent in path.parents if parent.exists())
        with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=nearest):
            pass
    except OSError as error:
        raise MotionError(f"{folder}: cannot be written ({error.strerror or error}); choose another folder") from None


def _refuse_foreign(folder: Path) -> None:
    """Only what a manifest lists may be replaced: a recording beside it could be the only copy."""
    if folder.exists() and {entry.name for entry in folder.iterdir()} - _saved_files(folder / MANIFEST):
        raise MotionError(f"{folder}: holds other files than saved clips; choose a new or an empty folder")


def _saved_files(manifest: Path) -> set[str]:
    """The names that `save_clips` wrote: the manifest's own and those that it lists; none where it cannot be read."""
    try:
        _, entries = read_manifest(read_bytes(manifest), str(manifest))
    except MotionError:
        return set()
    return {MANIFEST, *(entry["file"] for entry in entries)}


def _replace_folder(folder: Path, contents: dict[str, bytes]) -> None:
    """Write the files beside the folder, then rename; whatever fails leaves the folder as it was."""
    _refuse_foreign(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as beside:
        new, replaced = Path(beside, "new"), Path(beside, "replaced")
        new.mkdir()
        for name, data in contents.items():
            (new / name).write_bytes(data)
        if folder.exists():
            folder.rename(replaced)
        try:
            new.rename(folder)
        except OSError:
            if replaced.exists():
                replaced.rename(folder)
            raise


def read_clips(folder: Path, character: Character, only: str | None = None) -> list[Clip]:
    """The clips of a folder written by `save_clips`, in the manifest's order.

    Args:
        only: name of a file in the folder, to read that clip alone.

    Raises:
        MotionError: a manifest or a clip that is missing, damaged, or of another character.
    """
    manifest = folder / MANIFEST
    made_for, entries = read_manifest(read_bytes(manifest), str(manifest))
    if made_for != character.name:
        raise MotionError(
            f"{manifest}: its clips are for {made_for[:40]!a}, not {character.name}; choose clips made for it"
        )
    if only is not None:
        entries = [entry for entry in entries if entry["file"] == only]
        if not entries:
            raise MotionError(f"{manifest}: does not list {only}; choose a clip that it lists, or the folder")
    return [check_clip(_read_clip(folder / entry["file"], entry, made_for), character) for entry in entries]


def _read_clip(file: Path, entry: dict[str, Any], character: str) -> Clip:
    data = read_bytes(file)
    if hashlib.sha256(data).hexdigest() != entry["sha256"]:
        raise MotionError(f"{file}: is not the file that the manifest lists (sha256 differs); copy the folder anew")
    qpos = read_float_array(_unpack(data, file), str(file))
    if qpos.shape[:1] != (entry["frames"],):
        raise MotionError(f"{file}: is {list(qpos.shape)}, the manifest says {entry['frames']} frames; copy it anew")
    return Clip(
        name=entry["name"],
        character=character,
        fps=float(entry["fps"]),
        qpos=qpos,
        label=entry["label"],
        source=entry["source"],
        licence=entry["licence"],
        redistributable=entry["redistributable"],
        weight=float(entry["weight"]),
        loop=entry["loop"],
        masked=tuple(entry.get("masked", ())),
        origin=entry.get("origin", ""),
    )


def _unpack(data: bytes, file: Path) -> bytes:
    """The array's bytes in an .npz, which must not be more than the file's: so no small file becomes a large one."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            member = archive.getinfo(_MEMBER)
            if member.compress_type == zipfile.ZIP_STORED and member.file_size <= len(data):
                return archive.read(member)
    except (zipfile.BadZipFile, LookupError, ValueError, RuntimeError, EOFError, OSError, struct.error, zlib.error):
        raise MotionError(f"{file}: is no .npz with an array qpos, or is damaged; copy the file anew") from None
    raise MotionError(f"{file}: {_MEMBER} is compressed; save the clips with murmillo")
