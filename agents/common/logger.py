"""Scalars of a run, for people (TensorBoard) and for programs (CSV)."""

import csv
import math
import os
from collections.abc import Mapping
from pathlib import Path

from torch.utils.tensorboard.writer import SummaryWriter

CSV_NAME = "scalars.csv"


class Logger:
    """Appends one row an iteration to `scalars.csv` and the same numbers to TensorBoard, over samples.

    The first row of a run fixes the columns; a later name without a column goes to TensorBoard only. NaN, as of the
    mean length of no episode, is an empty cell.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.path = self.folder / CSV_NAME
        self._columns = next(iter(_rows(self.path)), [])
        self._writer: SummaryWriter | None = None

    def resume(self, samples: int) -> None:
        """Drop what was logged after `samples`, since the checkpoint that goes on from there will log it again."""
        header, *rows = _rows(self.path) or [[]]
        whole = [row for row in rows if len(row) == len(header) and int(row[0]) <= samples]
        if header:
            temporary = self.path.with_suffix(".csv.writing")
            with temporary.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([header, *whole])
            os.replace(temporary, self.path)
        self._writer = SummaryWriter(str(self.folder), purge_step=samples + 1)

    def log(self, samples: int, scalars: Mapping[str, float]) -> None:
        """Write the scalars of the iteration that ended at `samples`."""
        if not self._columns:
            self._columns = ["samples", *(name for name in scalars if name != "samples")]
            self._append(self._columns)
        cells = [scalars.get(name, math.nan) for name in self._columns[1:]]
        self._append([str(samples), *("" if math.isnan(cell) else repr(cell) for cell in cells)])
        self._writer = self._writer or SummaryWriter(str(self.folder))
        for name, value in scalars.items():
            if not math.isnan(value):
                self._writer.add_scalar(name, value, samples)

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()

    def _append(self, row: list[str]) -> None:
        with self.path.open("a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(row)


def _rows(path: Path) -> list[list[str]]:
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))
