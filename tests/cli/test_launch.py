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

from murmillo.agents.common.ranks import Ranks
from murmillo.cli import launch, runs
from murmillo.cli.config import TrainConfig, compose_train, save
from murmillo.cli.errors import CommandError

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


class Beside(Ranks):
    """One of two ranks; the other one is made up."""

    def gather(self, value: Any) -> list[Any]:
        other = OTHER.get(type(value), value)
        return [value, other] if self.first else [other, value]


OTHER: dict[type, Any] = {}


def test_a_mistake_is_said_once() -> None:
    def prepare() -> Any:
        raise CommandError("seed=x: needs an integer")

    with pytest.raises(CommandError, match=r"^seed=x: needs an integer$"):
        launch.agreed(Beside(0, 2), prepare)
    with pytest.raises(SystemExit) as ended:
        launch.agreed(Beside(1, 2), prepare)
    assert ended.value.code == 2


def test_worlds_that_do_not_divide_are_refused() -> None:
    with pytest.raises(CommandError, match=r"num_envs=9: .* take a multiple of 2"):
        launch.agreed(Beside(0, 2), lambda: compose_train(["num_envs=9"]))


def test_ranks_with_other_settings_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(OTHER, TrainConfig, compose_train(["runner.gamma=0.5"]))
    with pytest.raises(CommandError, match=r"runner.gamma=0.5: so says rank 1, but rank 0 has 0.95"):
        launch.agreed(Beside(0, 2), lambda: compose_train([]))
    with pytest.raises(SystemExit):
        launch.agreed(Beside(1, 2), lambda: compose_train([]))
    monkeypatch.setitem(OTHER, TrainConfig, compose_train([]))
    assert launch.agreed(Beside(0, 2), lambda: compose_train([])).seed == 1


def test_a_launch_finds_its_run_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = compose_train(["run.name=mine"])
    assert launch.launch_id() is None
    monkeypatch.setenv("TORCHELASTIC_RUN_ID", "job-7")
    run = Path("runs/mine")
    run.mkdir(parents=True)
    launch.mark(run)
    save(config, run)
    (run / runs.LAST).mkdir(parents=True)
    assert launch.begun(config) == run
    assert launch.open_run(config, "mine", Ranks()) == (run, True)
    assert launch.begun(compose_train(["seed=2"])) is None  # another run under the same id
    monkeypatch.setenv("TORCHELASTIC_RUN_ID", "job-8")
    assert launch.begun(config) is None
    monkeypatch.setenv("TORCHELASTIC_RUN_ID", "job-7")
    (run / runs.LAST).rmdir()
    assert launch.open_run(config, "mine", Ranks()) == (run, False)  # nothing was kept: it begins anew
    assert not run.exists()
