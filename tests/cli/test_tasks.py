"""Tasks from the command to the report: over a tiny low-level run and without one, taken up again, measured, filmed."""

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import pytest
import torch
from imageio_ffmpeg import count_frames_and_secs

from murmillo.cli import gl
from murmillo.cli.main import main
from murmillo.cli.tasks.checks import check_settings
from murmillo.cli.tasks.config import compose_task
from murmillo.cli.tasks.names import task_names
from tests.cli.refusals import assert_refused
from tests.cli.running import interrupted, rows
from tests.cli.tiny_tasks import TINY_TASK, assert_resumed_as_at_once

Murmillo = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def located(trained: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a tiny run of ASE, `low`, and one that has learned Location over it, `high`; only to be read."""
    root, threads = tmp_path_factory.mktemp("tasks"), torch.get_num_threads()
    shutil.copytree(trained, root / "low")
    assert main(["train", "task=location", f"low={root}/low", *TINY_TASK, f"run.root={root}", "run.name=high"]) == 0
    torch.set_num_threads(threads)
    return root


@pytest.fixture(scope="module")
def labelled(tmp_path_factory: pytest.TempPathFactory, tiny: tuple[str, ...]) -> Path:
    """The folder of a tiny run of C·ASE; it is only to be read."""
    root, threads = tmp_path_factory.mktemp("labelled"), torch.get_num_threads()
    short = ("runner.samples=64", "warm_start.steps=0")
    assert main(["train", "agent=case", *tiny, *short, f"run.root={root}", "run.name=low"]) == 0
    torch.set_num_threads(threads)
    return root / "low"


@pytest.fixture
def own(located: Path, folder: Path) -> Path:
    """A copy of these runs in the working folder; `high` still knows `low` by its first place."""
    return Path(shutil.copytree(located, folder / "runs"))


# --- composing -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", task_names())
def test_every_task_composes_at_every_budget(task: str) -> None:
    for budget in ("smoke", "laptop", "paper"):
        config = compose_task([f"task={task}", "low=none", f"budget={budget}"])
        check_settings(config, None)
        assert config.choices == {"task": task, "agent": "scratch", "budget": budget}
        assert config.make_task().reward_range[0] < config.make_task().reward_range[1]


def test_every_file_of_the_groups_is_reached() -> None:
    conf = files("murmillo.conf.tasks")
    names = {group: {Path(str(p)).stem for p in conf.joinpath(group).iterdir()} for group in ("agent", "budget")}
    assert names == {
        "agent": {"ase", "calm", "calm_precision", "case", "scratch"},
        "budget": {"smoke", "laptop", "paper"},
    }
    pairs = {f"{agent}_{budget}" for agent, budget in itertools.product(names["agent"], names["budget"])}
    assert {Path(str(p)).stem for p in conf.joinpath("agent_budget").iterdir()} <= pairs


def test_arguments_of_a_task_are_settings() -> None:
    config = compose_task(["task=path_follow", "low=none", "task.points=[[1,0],[2,1]]", "task.speed=[1,2]"])
    assert config.task.points == [[1, 0], [2, 1]]
    assert config.task.speed == (1.0, 2.0)
    assert config.make_task().goal_dim > 0


def test_what_the_low_level_run_decides(located: Path) -> None:
    config = compose_task(["task=location", f"low={located}/low", "budget=paper"])
    assert (config.env.window, config.env.starts.reference, config.env.starts.fallen) == (10, 0.0, 0.0)
    assert config.choices["agent"] == "ase"
    assert config.latent_env.terms == ("style",)
    assert config.runner.reward_weights == {"task": 0.9, "style": 0.1}
    assert config.agent.ppo.hidden == (1024, 512)
    scratch = compose_task(["task=location", "low=none", "budget=paper"])
    assert (scratch.latent_env.steps, scratch.latent_env.terms) == (1, ())
    assert scratch.runner.reward_weights == {"task": 1.0}
    assert scratch.agent.ppo.hidden == (1024, 1024, 512)


# --- runs ------------------------------------------------------------------------------------------------------------


def test_a_run_leaves_all_that_it_should(located: Path) -> None:
    high = located / "high"
    assert [row["samples"] for row in rows(high)] == ["16", "32"]
    assert {"reward/task", "reward/style"} <= rows(high)[0].keys()
    measures = json.loads((high / "measures.json").read_text())
    assert list(measures) == ["untrained", "random", "trained"]
    assert all(0.0 <= found["normalised_return"] <= 1.0 for found in measures.values())
    assert all(0 < found["length"] <= 12 for found in measures.values())
    text = (high / "report.md").read_text()
    for part in ("`location`", "random latents", "Normalised return", "ASE reports", "plots/learning_curve.png"):
        assert part in text
    assert (high / "plots" / "learning_curve.png").is_file()
    meta = json.loads((high / "checkpoints" / "last" / "meta.json").read_text())["values"]
    assert meta["meta/low"] == str(located / "low")
    assert len(meta["meta/low_digest"]) == 64


def test_resumed_run_equals_an_uninterrupted_one(murmillo: Murmillo, own: Path) -> None:
    assert_resumed_as_at_once(murmillo, own, "task=location")
    assert_refused(murmillo("train", "run.resume=runs/high", "seed=2"), "seed=2", "low")


def test_scratch_and_its_report(murmillo: Murmillo, folder: Path) -> None:
    status, _, err = murmillo("train", "task=steering", "low=none", *TINY_TASK, "run.name=alone")
    assert status == 0, err
    run = folder / "runs" / "alone"
    measures = json.loads((run / "measures.json").read_text())
    assert list(measures) == ["untrained", "trained"]
    assert -1.0 <= measures["trained"]["heading_cosine"] <= 1.0
    assert "no policy below" in (run / "report.md").read_text()
    status, out, err = murmillo("evaluate", "run=runs/alone", "worlds=3")
    assert status == 0, err
    assert "Normalised return" in out
    results = json.loads((run / "evaluation" / "metrics.json").read_text())
    assert results["trajectories"] == 3
    assert results["metrics"]["task"]["figures"]["normalised_return"]["values"]["trained"]["samples"] == 3


def test_evaluation_and_comparison(murmillo: Murmillo, own: Path) -> None:
    status, out, err = murmillo("evaluate", "run=runs/high", "worlds=3", "low=runs/low")
    assert status == 0, err
    assert "random latents" in out
    status, out, err = murmillo("compare", "runs/high", "out=beside")
    assert status == 0, err
    page = (own.parent / "beside" / "comparison.md").read_text()
    assert "Normalised return" in page
    assert "| 160 |" in page  # control steps, of 32 decisions
    assert (own.parent / "beside" / "reward_task.png").is_file()


@pytest.mark.parametrize(
    ("task", "told", "chooses"), [("direction", True, False), ("reach", False, True)], ids=["told", "autonomous"]
)
def test_over_case_a_label_is_told_or_chosen(
    murmillo: Murmillo, folder: Path, labelled: Path, task: str, told: bool, chooses: bool
) -> None:
    status, _, err = murmillo("train", f"task={task}", f"low={labelled}", "agent=case", *TINY_TASK, "run.name=high")
    assert status == 0, err
    run = folder / "runs" / "high"
    assert f"skill: {str(told).lower()}" in (run / "config.yaml").read_text()
    meta = json.loads((run / "checkpoints" / "last" / "meta.json").read_text())["values"]
    labels = len(meta["meta/skills"])
    assert meta["meta/action_dim"] == 16 + chooses * labels
    if task == "reach":
        assert json.loads((run / "measures.json").read_text())["trained"]["reach_error"] > 0.0


def test_a_film_has_a_picture_of_every_control_step(own: Path, folder: Path) -> None:
    if all(gl.why_not(backend) for backend in gl.candidates()):
        pytest.skip("no OpenGL draws on this machine")
    config = own / "high" / "config.yaml"
    config.write_text(config.read_text().replace("width: 640", "width: 64").replace("height: 480", "height: 48"))
    run = [sys.executable, "-m", "murmillo.cli.main", "record", "run=runs/high", "seconds=0.2", "skill=kick"]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert count_frames_and_secs(str(own / "high" / "video.mp4"))[0] == 6
    assert not list((own / "high").glob(".*"))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
def test_a_signal_ends_the_run_with_a_checkpoint_and_a_report(murmillo: Murmillo, folder: Path) -> None:
    """Ctrl-C, and then the run is taken up again."""
    words = ("task=location", "low=none", *TINY_TASK, "run.name=long")
    status, out, err = interrupted(signal.SIGINT, folder, *words)
    assert status == 0, err
    assert "go on with: murmillo train run.resume=runs/long" in out
    run = folder / "runs" / "long"
    assert "plots/learning_curve.png" in (run / "report.md").read_text()
    assert not (run / "measures.json").exists()
    done = int(rows(run)[-1]["samples"])
    status, _, err = murmillo("train", "run.resume=runs/long", f"runner.samples={done + 16}")
    assert status == 0, err
    assert int(rows(run)[-1]["samples"]) == done + 16
    assert "trained" in json.loads((run / "measures.json").read_text())


# --- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("task=locaton", "low=none"), ("task=locaton", "did you mean location")),
        (("task=location",), ("task=location", "low=runs/<name>", "low=none")),
        (("low=none",), ("low=none", "task=", "location")),
        (("task=location", "low=runs/nothing"), ("low=runs/nothing", "no such run")),
        (("task=location", "low=none", "agent=ase"), ("agent=ase", "agent=scratch")),
        (("task=location", "low=none", "task.radios=3"), ("task.radios", "radius")),
        (("task=location", "low=none", "task.radius=-1"), ("task.radius=-1", "above 0")),
        (("task=location", "low=none", "task.form=letter"), ("task.form", "letter", "paper")),
        (("task=location", "low=none", "budget=larg"), ("budget=larg", "laptop")),
        (("task=location", "low=none", "latent_env.steps=2"), ("latent_env", "low=none")),
        (("task=location", "low=none", "runner.reward_weights.task=nan"), ("reward_weights.task=nan", "finite")),
        (("task=location", "low=none", "agent.gumbel=1"), ("agent.gumbel=1", "agent=case")),
        (("task=location", "low=none", "runner.horizon=1", "num_envs=2"), ("agent.ppo.minibatch=1024", "at most 2")),
        (("task=location,strike", "low=none"), ("task=location,strike",)),
        (("--multirun", "task=location,strke", "low=none"), ("task=strke", "did you mean strike")),
    ],
)
def test_wrong_words(murmillo: Murmillo, folder: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    assert_refused(murmillo("train", *words), *parts)
    assert list(folder.iterdir()) == []


def test_a_low_level_run_that_does_not_serve(murmillo: Murmillo, own: Path, folder: Path) -> None:
    over = ("train", "task=location", *TINY_TASK, "run.name=new")
    assert_refused(murmillo(*over, "low=runs/low", "agent=calm"), "agent=calm", "run of ase", "agent=ase")
    assert_refused(murmillo(*over, "low=runs/high"), "low=runs/high", "learned a task itself")
    assert_refused(murmillo(*over, "low=runs/low", "env.window=4"), "env.window=4", "trained with 10")
    assert_refused(murmillo(*over, "low=runs/low", "env.character=humanoid"), "env.character=humanoid", "sword_shield")
    shutil.rmtree(own / "low" / "checkpoints")
    assert_refused(murmillo(*over, "low=runs/low"), "low=runs/low", "no checkpoint", "run.resume=runs/low")
    (folder / "no_run").mkdir()
    assert_refused(murmillo(*over, "low=no_run"), "low=no_run", "no run")
    assert not (own / "new").exists()


def test_a_low_level_checkpoint_of_another_character(murmillo: Murmillo, own: Path) -> None:
    meta = own / "low" / "checkpoints" / "last" / "meta.json"
    meta.write_text(meta.read_text().replace('"sword_shield"', '"centaur"'))
    assert_refused(
        murmillo("train", "task=location", "low=runs/low", *TINY_TASK, "run.name=new"), "low=runs/low", "centaur"
    )
    assert not (own / "new").exists()


def test_a_low_level_run_that_has_changed_or_gone(murmillo: Murmillo, own: Path) -> None:
    assert murmillo("train", "run.resume=runs/low", "runner.samples=192")[0] == 0
    for words in (
        ("evaluate", "run=runs/high", "low=runs/low"),
        ("train", "run.resume=runs/high", "low=runs/low", "runner.samples=48"),
    ):
        assert_refused(murmillo(*words), "low=runs/low", "not the one", "train a new policy")
    assert_refused(murmillo("evaluate", "run=runs/high", "low=runs/gone"), "low=runs/gone", "no such run")
    assert_refused(murmillo("evaluate", "run=runs/high", "metrics=all"), "metrics", "no such setting")
    assert [row["samples"] for row in rows(own / "high")] == ["16", "32"]


def test_multirun_trains_one_run_for_each_value(murmillo: Murmillo, folder: Path) -> None:
    words = ("task=location,speed", "low=none", *TINY_TASK, "runner.samples=16", "run.measured_worlds=1")
    status, _, err = murmillo("train", "--multirun", *words)
    assert status == 0, err
    names = sorted(run.name[20:] for run in (folder / "runs").iterdir())
    assert names == ["location-scratch-smoke-1-0", "speed-scratch-smoke-1-1"]


def test_imitation_is_the_training_without_a_task(murmillo: Murmillo, folder: Path) -> None:
    assert_refused(murmillo("train", "task=imitation", "num_envs=0"), "num_envs=0")
