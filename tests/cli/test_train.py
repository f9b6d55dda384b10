"""A run of two iterations from the command to its report, taken up again, measured and filmed."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from murmillo.agents.common.exactness import WORDS
from murmillo.agents.common.runner import Runner
from murmillo.agents.common.skill_model import SightedCritic
from murmillo.cli import gl
from murmillo.envs.tracking import PROGRESS_SIZE
from tests.cli.running import interrupted, rows

Murmillo = Callable[..., tuple[int, str, str]]


def test_a_run_leaves_all_that_it_should(trained: Path) -> None:
    for name in ("config.yaml", "versions.json", "scalars.csv", "measures.json", "report.md"):
        assert (trained / name).is_file(), name
    assert list(trained.glob("events.out.tfevents.*"))
    assert list((trained / "plots").glob("*.png"))
    assert [row["samples"] for row in rows(trained)] == ["64", "128"]
    assert list(json.loads((trained / "measures.json").read_text())) == ["untrained", "warm_started", "trained"]
    versions = json.loads((trained / "versions.json").read_text())
    assert versions["threads"] == 1
    assert versions["packages"]["torch"]


def test_resume_goes_on_with_the_same_settings(murmillo: Murmillo, own_run: Path) -> None:
    status, _, err = murmillo("train", "run.resume=runs/tiny", "runner.samples=192")
    assert status == 0, err
    assert [row["samples"] for row in rows(own_run)] == ["64", "128", "192"]
    assert "samples: 192" in (own_run / "config.yaml").read_text()
    status, _, err = murmillo("train", "run.resume=runs/tiny", "seed=2")
    assert status == 2
    assert "seed=2" in err


def test_a_resumed_run_that_is_stopped_keeps_no_figures_of_before(
    murmillo: Murmillo, own_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "## Did it learn?" in (own_run / "report.md").read_text()
    monkeypatch.setattr("murmillo.cli.training.Runner.run", lambda runner: signal.raise_signal(signal.SIGTERM))
    status, out, err = murmillo("train", "run.resume=runs/tiny", "runner.samples=192")
    assert status == 0, err
    assert "stopped at 128 samples" in out
    assert "## Did it learn?" not in (own_run / "report.md").read_text()


def test_resumed_run_equals_an_uninterrupted_one(murmillo: Murmillo, own_run: Path, tiny: tuple[str, ...]) -> None:
    """64 + 64 + 64 samples through a checkpoint and 192 at once end in the same figures."""
    assert murmillo("train", "run.resume=runs/tiny", "runner.samples=192")[0] == 0
    assert murmillo("train", *tiny, "run.name=whole", "runner.samples=192")[0] == 0
    resumed, whole = rows(own_run)[-1], rows(own_run.parent / "whole")[-1]
    assert resumed.pop("samples_per_second")
    assert whole.pop("samples_per_second")
    assert resumed == whole


def test_a_checkpoint_of_another_character(murmillo: Murmillo, own_run: Path) -> None:
    meta = own_run / "checkpoints" / "last" / "meta.json"
    meta.write_text(meta.read_text().replace('"sword_shield"', '"centaur"'))
    status, _, err = murmillo("evaluate", "run=runs/tiny", "worlds=4")
    assert status == 2
    assert "centaur" in err
    assert err.count("\n") == 1
    assert not (own_run / "evaluation").exists()


def test_multirun_trains_one_run_for_each_value(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...]) -> None:
    status, _, err = murmillo("train", "--multirun", *tiny, "runner.samples=64", "warm_start.steps=0", "seed=1,2")
    assert status == 0, err
    runs = sorted((folder / "runs").iterdir())
    assert [run.name[20:] for run in runs] == ["ase-smoke-1-0", "ase-smoke-2-1"]
    assert all((run / "report.md").is_file() for run in runs)


@pytest.mark.parametrize("ablation", ["no_skill_discovery", "no_diversity"])
def test_ablations_train(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...], ablation: str) -> None:
    status, _, err = murmillo("train", *tiny, f"ablation={ablation}", "runner.samples=64", "run.name=less")
    assert status == 0, err
    assert ("reward/skill" in rows(folder / "runs" / "less")[0]) == (ablation != "no_skill_discovery")


def test_a_run_whose_critic_sees_progress_is_taken_up_again_and_played_where_nobody_follows(
    murmillo: Murmillo, folder: Path, tiny: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen, value = [], SightedCritic.forward

    def noted(critic: SightedCritic, state: Tensor, told: Any) -> Tensor:
        seen.append(told["progress"].shape[-1])
        return value(critic, state, told)

    monkeypatch.setattr(SightedCritic, "forward", noted)
    follows = ("env.tracking.follow=true", "+runner.reward_weights.tracking=2", "agent.critic_progress=true")
    status, _, err = murmillo("train", *tiny, *follows, "runner.samples=64", "run.name=follows")
    assert status == 0, err
    status, _, err = murmillo("train", "run.resume=runs/follows", "runner.samples=128")
    assert status == 0, err
    assert set(seen) == {PROGRESS_SIZE}
    assert [row["samples"] for row in rows(folder / "runs" / "follows")] == ["64", "128"]
    known = len(seen)
    status, _, err = murmillo("evaluate", "run=runs/follows", "worlds=4")
    assert status == 0, err
    assert len(seen) == known


@pytest.mark.parametrize("matmul", ["tf32", "bf16"])
def test_a_run_that_rounds_is_measured_exactly(
    murmillo: Murmillo, folder: Path, tiny: tuple[str, ...], matmul: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Coverage refuses to measure with rounded products."""
    learned, run = [], Runner.run

    def noted(runner: Runner) -> None:
        learned.append(torch.get_float32_matmul_precision())
        run(runner)

    monkeypatch.setattr(Runner, "run", noted)
    words = (*tiny, f"matmul={matmul}", "runner.samples=64", "run.evaluate=true", "run.name=rounded")
    status, _, err = murmillo("train", *words)
    assert status == 0, err
    assert learned == [WORDS[matmul]]
    assert list((folder / "runs" / "rounded" / "evaluation").glob("*.json"))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
def test_a_signal_ends_the_run_with_a_checkpoint(folder: Path, tiny: tuple[str, ...]) -> None:
    status, out, err = interrupted(signal.SIGTERM, folder, *tiny, "run.name=long")
    assert status == 0, err
    assert "murmillo train run.resume=runs/long" in out
    assert (folder / "runs" / "long" / "checkpoints" / "last" / "meta.json").is_file()


def test_record(own_run: Path, folder: Path) -> None:
    if all(gl.why_not(backend) for backend in gl.candidates()):
        pytest.skip("no OpenGL draws on this machine")
    words = ("record", "run=runs/tiny", "seconds=0.2", "skill=walk_forward")
    done = subprocess.run(
        [sys.executable, "-m", "murmillo.cli.main", *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert b"ftyp" in (own_run / "video.mp4").read_bytes()[:16]
    assert list(own_run.glob(".*")) == []


def test_record_without_opengl(murmillo: Murmillo, own_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "off")
    status, _, err = murmillo("record", "run=runs/tiny")
    assert status == 2
    assert err.count("\n") == 1
    assert "OpenGL" in err
    assert not (own_run / "video.mp4").exists()


def test_a_run_on_warp_learns_and_is_played_on_the_cpu(
    murmillo: Murmillo, tiny: tuple[str, ...], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    warp = pytest.importorskip("warp", reason="physics=warp needs the extra gpu: pip install 'murmillo[gpu]'")
    monkeypatch.setattr(warp.config, "optimization_level", 1)  # as in tests/envs/test_warp.py, whose kernels it takes
    engine = ("physics=warp", "device=cpu", "env.contacts=48", "env.constraints=160")
    status, _, err = murmillo("train", *tiny, *engine, "run.name=warp")
    assert status == 0, err
    kept = rows(folder / "runs" / "warp")
    assert [row["samples"] for row in kept] == ["64", "128"]
    assert [row["episode/healed"] for row in kept] == ["0.0", "0.0"]
    status, _, err = murmillo("train", "run.resume=runs/warp", "runner.samples=192")
    assert status == 0, err
    assert [row["samples"] for row in rows(folder / "runs" / "warp")] == ["64", "128", "192"]
