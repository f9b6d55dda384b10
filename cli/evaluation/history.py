"""The figures of one run's checkpoints, a row an evaluation: how they come with the samples."""

import csv
from pathlib import Path
from typing import Any

from murmillo.cli import runs
from murmillo.cli.evaluation.sources import TRAINED

_CONDITIONS = ("samples", "checkpoint", "trajectories", "seed", "start")


def add(path: Path, results: dict[str, Any]) -> None:
    """Put the trained policy's figures into the table, in the place of those under the same conditions."""
    conditions = {name: str(results[name]) for name in _CONDITIONS}
    figures = {
        name: repr(figure["values"][TRAINED]["value"])
        for metric in results["metrics"].values()
        for name, figure in metric["figures"].items()
        if figure["values"].get(TRAINED, {}).get("value") is not None
    }
    others = [row for row in read(path) if any(row[name] != value for name, value in conditions.items())]
    rows = sorted([*others, {**conditions, **figures}], key=lambda row: int(row["samples"]))
    columns = list(dict.fromkeys(name for row in rows for name in row))
    lines = [columns, *([row.get(name, "") for name in columns] for row in rows)]
    runs.write_text(path, "".join(",".join(line) + "\n" for line in lines))


def read(path: Path) -> list[dict[str, str]]:
    """The rows, with the columns that they have; none where there is no file."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [{name: cell for name, cell in row.items() if cell} for row in csv.DictReader(file)]
