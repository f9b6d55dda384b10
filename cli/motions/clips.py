"""Clips as the commands take and leave them: found by a path, chosen by name, saved as a folder."""

import os
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path

from murmillo.cli.errors import CommandError, near_names
from murmillo.envs.character import Character, load_character
from murmillo.envs.motion import Clip, load_clips, save_clips
from murmillo.envs.motion.files import BUILTIN
from murmillo.envs.motion.manifest import MANIFEST, read_manifest
from murmillo.envs.motion.native import check_destination
from murmillo.envs.motion.reading import read_bytes

DEFAULT_CHARACTER = "sword_shield"


def load(path: str, character: str | None = None) -> tuple[list[Clip], Character]:
    """The clips at a path and the character that they are for: the one that is named, or the one of their manifest.

    Raises:
        SuiteError: the clips cannot be used, or there is no such character.
    """
    found = load_character(character or _character_of(path))
    return load_clips(path, found), found


def _character_of(path: str) -> str:
    place = Path(path)
    manifest = (place.parent if place.suffix.lower() == ".npz" else place) / MANIFEST
    if path == BUILTIN or not os.path.isfile(manifest):  # Path.is_file raises for a name that no file can have
        return DEFAULT_CHARACTER
    return read_manifest(read_bytes(manifest), str(manifest))[0]


def is_saved(path: str) -> bool:
    """Whether there is a folder of clips that murmillo saved, which needs no conversion."""
    return os.path.isfile(Path(path) / MANIFEST)


def select(clips: Sequence[Clip], name: str | None) -> list[Clip]:
    """The clip of this name alone, or all of them for None.

    Raises:
        CommandError: there is no clip of this name.
    """
    if name is None:
        return list(clips)
    chosen = [clip for clip in clips if clip.name == name]
    if not chosen:
        raise CommandError(f"--clip {name}: there is no such clip; {near_names(name, [clip.name for clip in clips])}")
    return chosen


def told_apart(new: Sequence[Clip], taken: Collection[str] = ()) -> list[Clip]:
    """The new clips, numbered where a name is taken, by one of these or by a clip before; in any case of letters."""
    names = {name.casefold() for name in taken}
    named = []
    for clip in new:
        numbered = (f"{clip.name}_{number}" for number in count(2))
        name = next(name for name in chain([clip.name], numbered) if name.casefold() not in names)
        names.add(name.casefold())
        named.append(replace(clip, name=name))
    return named


def check_folder(folder: str, replace: bool) -> None:
    """Refuse a folder for clips before any work is done for it.

    Raises:
        CommandError: it holds clips, and `replace` does not say that they may go.
        MotionError: it holds other files, or cannot be written.
    """
    check_destination(folder)
    if not replace and is_saved(folder):
        raise CommandError(f"--to {folder}: holds clips already; choose another folder, or replace them with --replace")


def save(folder: str, clips: Sequence[Clip]) -> None:
    """Write the clips and say so."""
    save_clips(folder, clips)
    seconds = sum(clip.duration for clip in clips)
    print(f"{len(clips)} clips, {seconds:.1f} s, written to {folder}")
