"""Prints the figures of a run as a table, and keeps them."""

import json
import os
import platform
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

BARE = "bare mj_step, all cores"


@dataclass(frozen=True)
class Figure:
    """What was measured.

    Attributes:
        name: of what was run.
        rate: control steps (or samples) a second.
        note: under which conditions.
        of_bare: rate over that of bare `mj_step` in the same round: median and range.
        ours_over_it: rate of our environment over this one in the same round: median and range.
        of_ase: rate over ASE's in the same round: median and range.
    """

    name: str
    rate: float
    note: str = ""
    of_bare: str = ""
    ours_over_it: str = ""
    of_ase: str = ""


FIGURES: list[Figure] = []


@pytest.fixture
def record(benchmark: Any) -> Callable[[Figure], None]:
    """`record(figure)` keeps a figure for the table and for pytest-benchmark's JSON."""

    def keep(figure: Figure) -> None:
        benchmark.extra_info[figure.name] = asdict(figure)
        FIGURES.append(figure)

    return keep


def pytest_terminal_summary(terminalreporter: Any) -> None:
    if not FIGURES:
        return
    table = markdown(FIGURES)
    terminalreporter.section("control steps a second")
    terminalreporter.write_line(table)
    folder = Path(os.environ.get("MURMILLO_BENCH", "benchmarks/results"))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "throughput.md").write_text(table + "\n", encoding="utf-8")
    (folder / "throughput.json").write_text(json.dumps([asdict(f) for f in FIGURES], indent=1) + "\n", encoding="utf-8")


def markdown(figures: list[Figure]) -> str:
    """The figures as a table, with the machine and the versions."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("mujoco", "torch", "gymnasium", "numpy"))
    lines = [
        f"{platform.machine()}, {os.cpu_count()} CPUs, Python {platform.python_version()}, {packages}",
        "",
        "| what | a second | of bare `mj_step` | ours over it | of ASE's | note |",
        "|---|---:|---:|---:|---:|---|",
    ]
    lines += [f"| {f.name} | {f.rate:,.0f} | {f.of_bare} | {f.ours_over_it} | {f.of_ase} | {f.note} |" for f in figures]
    return "\n".join(lines)
