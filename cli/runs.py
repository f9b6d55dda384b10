"""The folder of a run: what lies where in `runs/<name>/`, how it is begun and found again."""

import json
import os
import re
import time
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
EVALUATION = "evaluation.json"
REPORT = "report.md"
VIDEO = "video.mp4"
FILMING = "filming.json"
PLOTS = "plots"


def default_name(agent: str, budget: str, seed: int, suffix: str = "") -> str:
    """A name that sorts by time: 2026-01-31_12-00-00-ase-smoke-1."""
    return f"{time.strftime('%Y-%m-%d_%H-%M-%S')}-{agent}-{budget}-{seed}{suffix}"


def vacant(root: str, name: str) -> Path:
    """The folder of a new run, which is not made yet.

    Raises:
        CommandError: the name is no name of a folder, or there is such a run already.
    """
    if not re.fullmatch(r"[\w.+=,-]+", name) or name.startswith("."):
        raise CommandError(f"run.name={name}: a name has letters, digits and -_.+=, only; folders go into run.root")
    folder = Path(root) / name
    if folder.exists():
        raise CommandError(f"{folder}: there is such a run already; choose another run.name, or run.resume={folder}")
    if Path(root).exists() and not Path(root).is_dir():
        raise CommandError(f"run.root={root}: this is a file; name a folder for the runs")
    return folder


def existing(path: str, key: str) -> Path:
    """The folder of a run that was begun.

    Raises:
        CommandError: there is none at `path`, which the setting `key` named; with the near names beside it.
    """
    folder = Path(path)
    if (folder / CONFIG).is_file():
        return folder
    if folder.is_dir():
        raise CommandError(
            f"{key}={path}: this folder is no run, it has no {CONFIG}; name one that `murmillo train` made"
        )
    parent = folder.parent
    others = [other.parent.name for other in parent.glob(f"*/{CONFIG}")]
    known = near_names(folder.name, others) if others else f"there are no runs in {parent}"
    raise CommandError(f"{key}={path}: there is no such run; {known}")


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    beside = path.with_name(f".{path.name}.part")
    beside.write_text(text, encoding="utf-8")
    os.replace(beside, path)


def write_json(path: Path, values: Any) -> None:
    write_text(path, json.dumps(values, indent=2) + "\n")


def read_json(path: Path, default: Any = None) -> Any:
    """The file's values, or `default` where there is no such file."""
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else default
