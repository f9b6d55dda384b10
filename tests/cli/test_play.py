"""`murmillo play`: what it refuses, how a run is opened, and a page from the command to Ctrl-C."""

import importlib.util
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from murmillo.cli import play
from murmillo.cli.main import main
from tests.cli.refusals import assert_refused
from tests.cli.tiny_tasks import TINY_TASK

Murmillo = Callable[..., tuple[int, str, str]]


@pytest.fixture
def port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        ((), ("run", "needed")),
        (("run=runs/tinny",), ("run=runs/tinny", "did you mean tiny")),
        (("run=runs/tiny", "port=0"), ("port=0", "from 1 to 65535")),
        (("run=runs/tiny", "port=many"), ("port",)),
        (("run=runs/tiny", "host=no.such.host.invalid"), ("host=no.such.host.invalid (there is no such", "another")),
        (("run=runs/tiny", f"host={'é' * 70}.b"), ("there is no such IPv4 address",)),
        (("run=runs/tiny", "host=1.2.3.4"), ("host=1.2.3.4 (Cannot assign", "choose another")),
        (("run=",), ("run=: needs a value",)),
        (("run=runs/tiny", "port="), ("port=: needs a value", "8080")),
        (("run=runs/tiny", "seed=-1"), ("seed=-1", "from 0")),
        (("run=runs/tiny", "prot=80"), ("prot", "port")),
        (("run=runs/tiny", "low=runs/tiny"), ("low",)),
    ],
)
def test_mistakes(murmillo: Murmillo, own_run: Path, words: tuple, parts: tuple) -> None:
    assert_refused(murmillo("play", *words), *parts)


def test_a_port_that_is_in_use(murmillo: Murmillo, own_run: Path, port: int) -> None:
    with socket.create_server(("127.0.0.1", port)):
        assert_refused(
            murmillo("play", "run=runs/tiny", f"port={port}"),
            f"port={port}",
            "host=127.0.0.1",
            "Address already in use",
        )


def test_without_the_extra_pip_is_named(
    murmillo: Murmillo, own_run: Path, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    done = murmillo("play", "run=runs/tiny", f"port={port}")
    assert_refused(done, "viser", "pip install 'murmillo[play]'")


def test_a_run_of_an_agent_is_opened_with_its_clips_and_falls(trained: Path) -> None:
    session = play._open_agent(trained, play.AgentPlayConfig(str(trained), seed=3))
    assert session.plays_freely
    assert session.latents is not None
    for _ in range(3):
        session.step()
    assert session.look().status.seconds == pytest.approx(0.1)
    session.env.close()


def test_a_run_of_a_task_is_opened_over_the_run_below(trained: Path, tmp_path: Path) -> None:
    threads = torch.get_num_threads()
    words = ["task=location", f"low={trained}", *TINY_TASK, f"run.root={tmp_path}", "run.name=high"]
    assert main(["train", *words]) == 0
    torch.set_num_threads(threads)
    session = play._open_task(tmp_path / "high", play.TaskPlayConfig(str(tmp_path / "high")))
    assert session.latents is None
    assert session.goals.settable == ("target_w",)
    for _ in range(40):  # past the clock of the tiny run's episodes
        session.step()
    status = session.look().status
    assert {"position", "style"} <= status.rewards.keys()
    assert status.falls or status.seconds == pytest.approx(40 / 30)
    session.env.close()


def test_from_the_command_to_ctrl_c(own_run: Path, port: int) -> None:
    pytest.importorskip("viser", reason="the extra play is not installed")
    command = [sys.executable, "-m", "murmillo.cli.main", "play", "run=runs/tiny", f"port={port}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"open http://127.0.0.1:{port} to play runs/tiny; Ctrl-C ends it\n"
        with urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=60.0) as answer:
            assert answer.status == 200
        process.send_signal(signal.SIGINT)
        try:
            out, err = process.communicate(timeout=60.0)
        finally:
            process.kill()
    assert (process.returncode, out, err) == (0, "ended\n", "")
