import csv
import math
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from murmillo.agents.common.logger import CSV_NAME, Logger


def rows(folder: Path) -> list[list[str]]:
    with (folder / CSV_NAME).open(newline="") as file:
        return list(csv.reader(file))


def test_one_row_an_iteration(tmp_path: Path) -> None:
    logger = Logger(tmp_path)
    logger.log(10, {"samples": 10.0, "style": 0.5, "length": math.nan})
    logger.log(20, {"length": 3.0, "style": 0.25, "late": 1.0})
    logger.close()
    assert rows(tmp_path) == [["samples", "style", "length"], ["10", "0.5", ""], ["20", "0.25", "3.0"]]


def test_resuming_drops_what_will_be_done_again(tmp_path: Path) -> None:
    first = Logger(tmp_path)
    for samples in (10, 20, 30):
        first.log(samples, {"style": float(samples)})
    first.close()
    with (tmp_path / CSV_NAME).open("a") as file:
        file.write("4")  # a row that a crash cut short
    again = Logger(tmp_path)
    again.resume(20)
    again.log(30, {"style": -1.0})
    again.close()
    assert rows(tmp_path) == [["samples", "style"], ["10", "10.0"], ["20", "20.0"], ["30", "-1.0"]]


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_tensorboard_can_read_it(tmp_path: Path) -> None:
    logger = Logger(tmp_path)
    logger.log(10, {"style": 0.5})
    logger.close()
    events = EventAccumulator(str(tmp_path))
    events.Reload()
    assert [(event.step, event.value) for event in events.Scalars("style")] == [(10, 0.5)]
