"""The figures of one run's checkpoints, a row an evaluation: how they come with the samples."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from murmillo.cli import runs
from murmillo.cli.evaluation.sources import TRAINED

_CONDITIONS = ("samples", "checkpoint", "trajectories", "seed", "start")


def add(path: Path, results: Mapping[str, Any]) -> None:
    """Put the trained policy's figures into the table, beside and over those under the same conditions."""
    figures = {
        name: repr(figure["values"][TRAINED]["value"])
        for metric in results["metrics"].values()
        for name, figure in metric["figures"].items()
        if figure["values"].get(TRAINED, {}).get("value") is not None
    }
    alike, others = _divided(path, results)
    row = {**alike, **_conditions(results), **figures}
    rows = sorted([*others, row], key=lambda row: int(row["samples"]))
    columns = list(dict.fromkeys(name for row in rows for name in row))
    lines = [columns, *([row.get(name, "") for name in columns] for row in rows)]
    runs.write_text(path, "".join(",".join(line) + "\n" for line in lines))


def known(path: Path, identity: Mapping[str, Any]) -> set[str]:
    """Names of the figures that the table has under these conditions."""
    return _divided(path, identity)[0].keys() - set(_CONDITIONS)


def read(path: Path) -> list[dict[str, str]]:
    """The rows, with the columns that they have; none where there is no file."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [{name: cell for name, cell in row.items() if cell} for row in csv.DictReader(file)]


def _divided(path: Path, identity: Mapping[str, Any]) -> tuple[dict[str, str], list[dict[str, str]]]:
    """The row under these conditions, empty where there is none, and the others."""
    conditions, rows = _conditions(identity), read(path)
    alike = [row for row in rows if all(row[name] == value for name, value in conditions.items())]
    return alike[0] if alike else {}, [row for row in rows if row not in alike]


def _conditions(identity: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(identity[name]) for name in _CONDITIONS}
