"""Real processes of torchrun that share a run: one is killed in its midst, and the run goes on."""

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from murmillo.cli import runs

TORCHRUN = (sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2", "--max-restarts=1")
SAMPLES = 64 * 30


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="finds the processes in /proc")
def test_a_killed_rank_is_started_again_and_the_run_goes_on(folder: Path, tiny: tuple[str, ...]) -> None:
    words = ("-m", "murmillo.cli.train", *tiny, f"runner.samples={SAMPLES}", "runner.checkpoint_minutes=0")
    torchrun = subprocess.Popen([*TORCHRUN, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        first = until(lambda: next(iter(Path("runs").glob(f"*/{runs.LAST}/meta.json")), None), torchrun)
        os.kill(until(lambda: worker(torchrun.pid, rank=1), torchrun), signal.SIGKILL)
        out, err = torchrun.communicate(timeout=120)
    finally:
        torchrun.kill()
    assert torchrun.returncode == 0, err
    run = first.parents[2]
    assert list(Path("runs").iterdir()) == [run]  # a restart begins no other
    assert out.count("over 2 ranks") == 2
    assert out.count("warm start:") == 2  # the second time there is none: it went on from a checkpoint
    assert "murmillo: another rank was lost" in err
    assert "murmillo: rank 1" not in err
    with (run / runs.SCALARS).open(newline="") as file:
        assert [int(row["samples"]) for row in csv.DictReader(file)] == list(range(64, SAMPLES + 1, 64))
    assert (run / runs.REPORT).is_file()


def until(found: Callable, process: subprocess.Popen) -> Any:
    """What `found` gives as soon as that is something."""
    end = time.monotonic() + 120
    while (thing := found()) is None:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)
    return thing


def worker(parent: int, rank: int) -> int | None:
    """The process of that rank."""
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    for child in children:
        if f"RANK={rank}".encode() in Path(f"/proc/{child}/environ").read_bytes().split(b"\0"):
            return int(child)
    return None
