"""What the benchmarks share: how long they try, and the record that they write."""

import os
from dataclasses import dataclass
from typing import Any

import pytest

from benchmarks.record import FOLDER, MARKDOWN, Record
from murmillo.cli.benching.turns import Contestant, Rates, one_round

_RECORD = pytest.StashKey[Record]()


def pytest_addoption(parser: Any) -> None:
    parser.addoption("--quick", action="store_true", help="try the benchmarks themselves: few worlds, two rounds")


def pytest_configure(config: Any) -> None:
    config.addinivalue_line("markers", "gate: its ratios are kept in baseline.json")
    config.stash[_RECORD] = Record(os.getloadavg()[0], bool(config.getoption("--quick")))


def pytest_terminal_summary(terminalreporter: Any, config: Any) -> None:
    record = config.stash[_RECORD]
    if record.figures or record.ratios:
        record.save(FOLDER)
        terminalreporter.section(str(FOLDER / MARKDOWN))
        terminalreporter.write_line(record.markdown())


@dataclass(frozen=True)
class Effort:
    """How much is done: all of it, or a trial of the benchmarks themselves."""

    quick: bool

    def worlds(self, wanted: int) -> int:
        return min(wanted, 64) if self.quick else wanted

    def rounds(self, wanted: int) -> int:
        return min(wanted, 2) if self.quick else wanted

    def run(self, benchmark: Any, contestants: list[Contestant], rounds: int, warm_up: int = 1) -> list[Rates]:
        """Rounds of turns; those that warm up are forgotten."""
        done: list[Rates] = []
        rounds = self.rounds(rounds)
        benchmark.pedantic(lambda: done.append(one_round(contestants)), rounds=rounds, warmup_rounds=warm_up)
        benchmark.extra_info["rounds"] = done
        return done[warm_up:]


@pytest.fixture
def effort(pytestconfig: pytest.Config) -> Effort:
    return Effort(bool(pytestconfig.getoption("--quick")))


@pytest.fixture
def record(pytestconfig: pytest.Config) -> Record:
    """Figures and ratios for the tables of this run."""
    return pytestconfig.stash[_RECORD]
