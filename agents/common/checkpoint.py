"""Checkpoints: a folder of `tensors.safetensors` and `meta.json`, whole or not there, and free of code."""

import json
import os
import shutil
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import safetensors.torch
from safetensors import SafetensorError
from torch import Tensor

from murmillo.agents.common.errors import AgentError

FORMAT = "murmillo-checkpoint"
VERSION = 5
"""Grows whenever what is saved takes another form."""
TENSORS = "tensors.safetensors"
META = "meta.json"


def save(folder: Path | str, state: Mapping[str, Any]) -> None:
    """Write nested dicts of tensors and JSON values, so that a crash at any moment leaves a whole checkpoint.

    Both files are written to a sibling folder and flushed to the disk; then the old folder steps aside, the new one
    takes its name, and the old one goes. `load` finds the old one should the crash come in between.

    Args:
        folder: where; its parent folders are made.
        state: keys are strings without "/".
    """
    folder = Path(folder)
    writing, previous = _siblings(folder)
    tensors, values = _flatten(state)
    shutil.rmtree(writing, ignore_errors=True)
    writing.mkdir(parents=True)
    safetensors.torch.save_file(tensors, writing / TENSORS)
    meta = {"format": FORMAT, "version": VERSION, "tensors_crc32": _crc32(writing / TENSORS), "values": values}
    (writing / META).write_text(json.dumps(meta, indent=1) + "\n", encoding="utf-8")
    for path in (writing / TENSORS, writing / META, writing):
        _flush(path)
    if folder.exists():
        shutil.rmtree(previous, ignore_errors=True)
        os.replace(folder, previous)
    os.replace(writing, folder)
    _flush(folder.parent)
    shutil.rmtree(previous, ignore_errors=True)


def load(folder: Path | str) -> dict[str, Any]:
    """The nested state that `save` was given.

    Raises:
        AgentError: it is missing, truncated, altered, something else or of another version.
    """
    folder = Path(folder)
    _, previous = _siblings(folder)
    if not folder.exists() and previous.exists():
        folder = previous
    for name in (META, TENSORS):
        if not (folder / name).is_file():
            raise AgentError(f"{folder} is no checkpoint: it has no {name}")
    try:
        meta = json.loads((folder / META).read_text(encoding="utf-8"))
    except ValueError:
        raise AgentError(f"{folder / META} is damaged: not JSON; take an earlier checkpoint") from None
    if not isinstance(meta, dict) or meta.get("format") != FORMAT:
        raise AgentError(f"{folder / META} is no {FORMAT} file")
    if meta.get("version") != VERSION:
        raise AgentError(
            f"{folder} is a checkpoint of version {meta.get('version')}, this program's are of version {VERSION}: "
            "train it anew, or use the commit in the run's versions.json"
        )
    damaged = AgentError(f"{folder / TENSORS} is damaged or of another save; take an earlier checkpoint")
    if _crc32(folder / TENSORS) != meta.get("tensors_crc32") or not isinstance(meta.get("values"), dict):
        raise damaged
    try:
        tensors = safetensors.torch.load_file(folder / TENSORS)
    except SafetensorError:
        raise damaged from None
    return _nest({**meta["values"], **tensors})


def check_compatible(meta: Mapping[str, Any], expected: Mapping[str, Any]) -> None:
    """Compare what a checkpoint was made with (character, dimensions, skills, ...) with what is here.

    Raises:
        AgentError: they differ; one line with every difference.
    """
    differences = [
        f"{name} is {_shown(meta.get(name))} there, {_shown(value)} here"
        for name, value in expected.items()
        if meta.get(name) != value
    ]
    if differences:
        raise AgentError(f"the checkpoint does not fit: {'; '.join(differences)}")


def _shown(value: Any) -> str:
    """The value, of a long list its length and its ends."""
    if isinstance(value, list) and len(value) > 6:
        return f"{len(value)} from {value[0]!r} to {value[-1]!r}"
    return repr(value)


def _siblings(folder: Path) -> tuple[Path, Path]:
    return folder.with_name(f".{folder.name}.writing"), folder.with_name(f".{folder.name}.previous")


def _flatten(state: Mapping[str, Any], prefix: str = "") -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors and JSON values by path; an empty dict is a value."""
    tensors: dict[str, Tensor] = {}
    values: dict[str, Any] = {}
    for key, value in state.items():
        if not isinstance(key, str) or "/" in key:
            raise TypeError(f"checkpoint key {prefix}{key!r} is not a string without '/'")
        path = prefix + key
        if isinstance(value, Tensor):
            tensors[path] = value.detach().cpu().contiguous().clone()
        elif isinstance(value, Mapping) and value:
            inner_tensors, inner_values = _flatten(value, f"{path}/")
            tensors |= inner_tensors
            values |= inner_values
        else:
            try:
                json.dumps(value)
            except TypeError:
                raise TypeError(f"checkpoint value '{path}' is a {type(value).__name__}, no tensor or JSON") from None
            values[path] = value
    return tensors, values


def _nest(flat: Mapping[str, Any]) -> dict[str, Any]:
    state: dict[str, Any] = {}
    for path, value in flat.items():
        *parents, key = path.split("/")
        level = state
        for parent in parents:
            level = level.setdefault(parent, {})
        level[key] = value
    return state


def _crc32(path: Path) -> int:
    checksum = 0
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            checksum = zlib.crc32(chunk, checksum)
    return checksum


def _flush(path: Path) -> None:
    """Force a file's or folder's content onto the disk (Windows opens no folder, and needs no flush of one)."""
    if os.name == "nt" and path.is_dir():
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
