"""Loading clips, whatever they are stored as, and saving them."""

import os
from collections.abc import Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from importlib import resources
from pathlib import Path

from murmillo.envs.character import Character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.dataset import SUFFIXES, read_dataset
from murmillo.envs.motion.formats.poselib import read_poselib
from murmillo.envs.motion.manifest import MANIFEST
from murmillo.envs.motion.native import read_clips, save_clips
from murmillo.envs.motion.reading import read_bytes

__all__ = ["BUILTIN", "load_clips", "save_clips"]

BUILTIN = "builtin"


def load_clips(path: str | Path, character: Character, names: Sequence[str] = ()) -> list[Clip]:
    """Clips for the character, checked: finite, of its layout, with unit quaternions continuous in sign.

    Args:
        path: one of
            - "builtin", the clips that come with murmillo;
            - a folder with manifest.json, written by `save_clips`;
            - a folder with poselib .npy files: those that its dataset yaml lists, with their weights, or all of them
              where there is no yaml;
            - a dataset yaml (`motions: [{file, weight}]`) beside poselib files, or above them;
            - one poselib .npy, or one .npz of a folder with manifest.json.
        character: whose clips they are.
        names: of those that are wanted, or patterns such as "walk_*"; empty for all. They keep their order.

    Raises:
        MotionError: nothing there, a file that is damaged, belongs to another character or asks for code to be run, or
            a name that no clip has.
    """
    clips = _load(path, character)
    for name in names:
        if not any(fnmatchcase(clip.name, name) for clip in clips):
            known = [clip.name for clip in clips]
            near = get_close_matches(name, known, n=1)
            listed = ", ".join(known[:8] + ["…"] * (len(known) > 8))
            hint = f"did you mean {near[0]}?" if near else f"there are: {listed}"
            raise MotionError(f"clips={name[:80]}: no clip of motions={path} is called so; {hint}")
    return [clip for clip in clips if not names or any(fnmatchcase(clip.name, name) for name in names)]


def _load(path: str | Path, character: Character) -> list[Clip]:
    if str(path) == BUILTIN:
        return _load_builtin(character)
    path = Path(path)
    if not os.path.exists(path):  # Path.exists raises for a name that no file can have
        raise MotionError(f"motions={path}: there is no such file or folder; give the path of clips, or {BUILTIN}")
    if path.is_dir():
        return _load_folder(path, character)
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return _load_poselib({path: 1.0}, character)
    if suffix == ".npz":
        return read_clips(path.parent, character, only=path.name)
    if suffix in SUFFIXES:
        return _load_poselib(_read_dataset(path, character), character)
    raise MotionError(
        f"motions={path}: files of type {suffix or '(none)'} are unknown; known are .npy, .npz and .yaml, and "
        "`murmillo motions import` makes clips of others"
    )


def _load_builtin(character: Character) -> list[Clip]:
    packs = Path(str(resources.files("murmillo.assets.motions")))
    if not (packs / character.name / MANIFEST).is_file():
        known = ", ".join(sorted(file.parent.name for file in packs.glob(f"*/{MANIFEST}"))) or "no character"
        raise MotionError(f"motions={BUILTIN}: has clips for {known}, not for {character.name}; give the path of clips")
    return read_clips(packs / character.name, character)


def _load_folder(folder: Path, character: Character) -> list[Clip]:
    try:
        files = sorted(folder.iterdir())
    except OSError as error:
        raise MotionError(f"motions={folder}: cannot be read ({error.strerror or error}); check the path") from None
    if folder / MANIFEST in files:
        return read_clips(folder, character)
    clips = {file: 1.0 for file in files if file.suffix.lower() == ".npy"}
    if not clips:
        raise MotionError(
            f"motions={folder}: holds neither {MANIFEST} nor .npy clips; make clips with `murmillo motions import`"
        )
    datasets = {file: _read_dataset(file, character) for file in files if file.suffix.lower() in SUFFIXES}
    if not datasets:
        return _load_poselib(clips, character)
    complete = {file: weights for file, weights in datasets.items() if set(weights) <= set(clips)}
    if not complete:
        file, weights = next(iter(datasets.items()))
        missing = min(set(weights) - set(clips)).name
        raise MotionError(
            f"{file}: lists {missing[:80]!a}, which is not in the folder; add the clip or remove the entry"
        )
    if len(complete) > 1:
        names = ", ".join(file.name for file in complete)
        raise MotionError(f"motions={folder}: holds several datasets ({names}); give the path of one of them instead")
    return _load_poselib(next(iter(complete.values())), character)


def _load_poselib(weights: dict[Path, float], character: Character) -> list[Clip]:
    return [read_poselib(read_bytes(file), file, character, weight) for file, weight in weights.items()]


def _read_dataset(file: Path, character: Character) -> dict[Path, float]:
    """The clips that a dataset lists and their weights, which it must give."""
    weights = read_dataset(file)
    if foreign := [clip.name for clip in weights if clip.suffix.lower() != ".npy"]:
        raise MotionError(
            f"{file}: lists {foreign[0][:80]!a}, which is no .npy clip; make clips of them with "
            f"`murmillo motions import {file} --to FOLDER --character {character.name}` and give that folder"
        )
    for clip, weight in weights.items():
        if weight is None:
            raise MotionError(f"{file}: gives {clip.name[:80]!a} no weight; write a number above 0")
    return {clip: weight for clip, weight in weights.items() if weight is not None}
