"""Several processes learn what one does. Two of them, started once, run everything that is compared here."""

import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor
from torch.multiprocessing.spawn import spawn

from murmillo.agents.common import checkpoint
from tests.agents.toy import equal, small_ase
from tests.agents.toy_ranks import run_as, train_alone

HINGE = replace(small_ase().discriminator, loss="hinge")
RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "ase": ("ase", {"ppo": replace(small_ase().ppo, noise_correlation=0.5, quiet_share=0.4)}),
    "case": ("case", {"discriminator": small_ase().discriminator}),  # without dropout
    "calm": ("calm", {}),
    "ase_hinge": ("ase", {"discriminator": HINGE}),
    "calm_shuffled": ("calm", {"negatives": "shuffled"}),
    "case_adapted": ("case", {"discriminator": small_ase().discriminator, "adapted": True}),
    "calm_adapted": ("calm", {"adapted": True}),
    "case_dropout": ("case", {}),
}


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where two processes left their runs."""
    folder = tmp_path_factory.mktemp("two")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    spawn(run_as, (2, port, folder, RUNS), nprocs=2)
    return folder


@pytest.mark.parametrize("name", [name for name in RUNS if name != "case_dropout"])
def test_two_processes_learn_what_one_does(name: str, shared: Path, tmp_path: Path) -> None:
    train_alone(tmp_path, *RUNS[name])
    one, two = (checkpoint.load(folder / "whole") for folder in (tmp_path, shared / name))
    for part in ("generator", "samples", "iteration"):
        assert equal(one[part], two[part])
    drop = ("owner", "ranks")
    assert_close(one["agent"], two["agent"], drop)
    assert_close(one["watch"]["trends"], two["watch"]["trends"])
    stats = [torch.load(folder / "stats.pt") for folder in (tmp_path, shared / name)]
    for mine, theirs in zip(*stats, strict=True):
        mine["samples_per_second"] = theirs["samples_per_second"] = 0.0
        assert theirs == pytest.approx(mine, rel=1e-4, abs=1e-5, nan_ok=True)


@pytest.mark.parametrize("name", RUNS)
def test_as_many_ranks_go_on_bit_for_bit(name: str, shared: Path) -> None:
    assert equal(*(checkpoint.load(shared / name / half) for half in ("whole", "halves")))


def assert_close(one: Any, two: Any, without: tuple[str, ...] = (), path: str = "") -> None:
    if isinstance(one, dict):
        assert one.keys() == two.keys() - set(without), path
        for key in one:
            assert_close(one[key], two[key], without, f"{path}/{key}")
    elif isinstance(one, Tensor):
        torch.testing.assert_close(two, one, rtol=1e-4, atol=1e-5, msg=lambda text: f"{path}: {text}")
    else:
        assert two == pytest.approx(one, rel=1e-4, abs=1e-5), path
