"""Runs that are stopped, and what runs log."""

import csv
import signal
import subprocess
import sys
from pathlib import Path


def rows(folder: Path) -> list[dict[str, str]]:
    """What a run has logged, an iteration a row."""
    with (folder / "scalars.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def interrupted(number: signal.Signals, folder: Path, *words: str) -> tuple[int, str, str]:
    """Train by these words in a process of its own, which gets a signal after some iterations; as `murmillo` has it."""
    command = [sys.executable, "-m", "murmillo.cli.main", "train", *words, "runner.samples=1000000000"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if " samples, " in line:
                process.send_signal(number)
                break
        out, err = process.communicate(timeout=60)
    return process.returncode, out, err
