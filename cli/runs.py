"""The folder of a run: what lies where in `runs/<name>/`, how it is begun and found again."""

import json
import os
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from murmillo.cli.errors import CommandError, near_names

CONFIG = "config.yaml"
VERSIONS = "versions.json"
TERMS = "terms.json"
SKILLS = "skills.json"
NOTICES = "notices.json"
SCALARS = "scalars.csv"
CHECKPOINTS = "checkpoints"
LAST = f"{CHECKPOINTS}/last"
WARM_STARTED = f"{CHECKPOINTS}/warm_started"
MEASURES = "measures.json"
CLIPS = "clips.json"
EVALUATION = "evaluation"
METRICS = f"{EVALUATION}/metrics.json"
CURVES = f"{EVALUATION}/curves.json"
MACHINES = "machines"
HISTORY = f"{EVALUATION}/history.csv"
EVALUATED = "evaluation.md"
EVALUATED_HTML = "evaluation.html"
REPORT = "report.md"
VIDEO = "video.mp4"
FILMING = "filming.json"
LAUNCH = "launch.json"
PLOTS = "plots"

MERGED = "merged"
"""Among the choices of a run's settings: the adaptation that it was merged of."""
_NAME = re.compile(r"[\w+=,-][\w.+=,-]{0,199}")


def default_name(agent: str, budget: str, seed: int, suffix: str = "") -> str:
    """A name that sorts by time: 2026-01-31_12-00-00-ase-smoke-1."""
    return f"{time.strftime('%Y-%m-%d_%H-%M-%S')}-{agent}-{budget}-{seed}{suffix}"


def vacant(root: str, name: str) -> Path:
    """The folder of a new run, which is not made yet.

    Raises:
        CommandError: the name is no name of a folder, or there is such a run already.
    """
    if not _NAME.fullmatch(name):
        raise CommandError(
            f"run.name={name}: a name has up to 200 letters, digits and -_.+=, only; a folder is run.root"
        )
    folder = Path(root) / name
    if os.path.exists(folder):
        raise CommandError(f"{folder}: there is such a run already; choose another run.name, or run.resume={folder}")
    if os.path.isfile(root):
        raise CommandError(f"run.root={root}: this is a file; name a folder for the runs")
    return folder


def vacant_at(path: str, key: str) -> Path:
    """The folder of a new run, which is not made yet, in a folder that is there.

    Raises:
        CommandError: the name is no name of a folder, there is something of that name, or no folder to have it.
    """
    folder = Path(path)
    if not _NAME.fullmatch(folder.name):
        raise CommandError(f"{key}={path}: the name of a run has up to 200 letters, digits and -_.+=, only")
    if os.path.lexists(folder):
        raise CommandError(f"{key}={path}: there is something of this name already; choose another name")
    if not os.path.isdir(folder.parent):
        raise CommandError(f"{key}={path}: there is no folder {folder.parent}; make it, or choose another")
    return folder


def make(folder: Path) -> None:
    """Make the folder of a new run.

    Raises:
        CommandError: the system does not let it.
    """
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise CommandError(
            f"{folder}: cannot be made ({error.strerror or error}); choose another run.root or run.name"
        ) from None


def existing(path: str, key: str) -> Path:
    """The folder of a run that was begun.

    Raises:
        CommandError: there is none at `path`, which the setting `key` named; with the near names beside it.
    """
    folder = Path(path)
    if os.path.isfile(folder / CONFIG):  # Path.is_file raises for a name that no file can have
        return folder
    if os.path.isdir(folder):
        raise CommandError(
            f"{key}={path}: this folder is no run, it has no {CONFIG}; name one that `murmillo train` made"
        )
    parent = folder.parent
    others = [other.parent.name for other in parent.glob(f"*/{SCALARS}")]  # other folders have a config.yaml too
    known = near_names(folder.name, others) if others else f"there are no runs in {parent}"
    raise CommandError(f"{key}={path}: there is no such run; {known}")


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all.

    Raises:
        CommandError: the system does not let it.
    """
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, path)
    except OSError as error:
        with suppress(OSError):
            beside.unlink()
        raise CommandError(f"{path}: cannot be written ({error.strerror or error})") from None


def write_json(path: Path, values: Any) -> None:
    write_text(path, json.dumps(values, indent=2) + "\n")


def read_json(path: Path, default: Any = None) -> Any:
    """The file's values, or `default` where there is no such file."""
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else default
