"""The commands, run in this process and in a folder of their own."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
import torch

from murmillo.cli.main import main


class Done(NamedTuple):
    status: int
    out: str
    err: str


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty working folder; a command may set torch's threads, which are given back."""
    threads = torch.get_num_threads()
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    torch.set_num_threads(threads)


@pytest.fixture
def murmillo(folder: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """`murmillo("train", "seed=1")` gives the exit status and what was printed."""

    def run(*words: str) -> Done:
        status = main(list(words))
        printed = capsys.readouterr()
        return Done(status, printed.out, printed.err)

    return run


TINY = (
    "num_envs=8",
    "runner.horizon=8",
    "runner.samples=128",
    "agent.ppo.hidden=[16]",
    "agent.ppo.minibatch=32",
    "agent.ppo.epochs=1",
    "agent.discriminator.hidden=[16]",
    "agent.discriminator.minibatch=16",
    "warm_start.steps=2",
    "threads=1",
    "run.measured_worlds=2",
    "run.video=false",
    "run.evaluate=false",
    "env.starts.fallen=0",
    "env.width=64",
    "env.height=48",
)


@pytest.fixture(scope="session")
def tiny() -> tuple[str, ...]:
    """Settings of a run of two iterations that takes a second."""
    return TINY


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished tiny run; it is only to be read."""
    root, threads = tmp_path_factory.mktemp("runs"), torch.get_num_threads()
    assert main(["train", *TINY, f"run.root={root}", "run.name=tiny"]) == 0
    torch.set_num_threads(threads)
    return root / "tiny"


@pytest.fixture
def own_run(trained: Path, folder: Path) -> Path:
    """A copy of that run, as runs/tiny in the working folder."""
    return Path(shutil.copytree(trained, folder / "runs" / "tiny"))
