"""Prints the figures of a run side by side, as ratios to bare mj_step."""

import json
import os
import platform
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

RESULTS: list[tuple[str, float, str]] = []
"""What was measured: a name, control steps (or samples) a second, a note."""

RATIOS = ("all cores", "step", "sync", "async", "Humanoid-v4", "rollout")
"""Endings of the names that are control steps, and so can be set against bare mj_step."""

BARE = "bare mj_step, all cores"


@pytest.fixture
def record(benchmark: Any) -> Callable[[str, float, str], None]:
    """`record(name, rate, note)` keeps a figure for the table and for pytest-benchmark's JSON."""

    def keep(name: str, rate: float, note: str = "") -> None:
        benchmark.extra_info[name] = rate
        RESULTS.append((name, rate, note))

    return keep


def pytest_terminal_summary(terminalreporter: Any) -> None:
    if not RESULTS:
        return
    table = markdown(RESULTS)
    terminalreporter.section("control steps a second")
    terminalreporter.write_line(table)
    folder = Path(os.environ.get("MURMILLO_BENCH", "benchmarks/results"))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "throughput.md").write_text(table + "\n", encoding="utf-8")
    (folder / "throughput.json").write_text(json.dumps(RESULTS, indent=1) + "\n", encoding="utf-8")


def markdown(results: list[tuple[str, float, str]]) -> str:
    """The results as a table, with the machine and the versions."""
    bare = next((rate for name, rate, _ in results if name == BARE), None)
    packages = ", ".join(f"{name} {version(name)}" for name in ("mujoco", "torch", "gymnasium", "numpy"))
    lines = [
        f"{platform.machine()}, {os.cpu_count()} CPUs, Python {platform.python_version()}, {packages}",
        "",
        "| what | a second | of bare `mj_step` | note |",
        "|---|---:|---:|---|",
    ]
    for name, rate, note in results:
        ratio = f"{rate / bare:.2f}" if bare and name.endswith(RATIOS) else ""
        lines.append(f"| {name} | {rate:,.0f} | {ratio} | {note} |")
    return "\n".join(lines)
