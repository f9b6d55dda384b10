"""CALM's precision training from the command to the report, over a tiny run of CALM: measured, resumed, filmed."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from imageio_ffmpeg import count_frames_and_secs

from murmillo.cli import gl
from murmillo.cli.errors import CommandError
from murmillo.cli.main import main
from murmillo.cli.tasks import low as low_runs
from murmillo.cli.tasks.checks import check_settings
from murmillo.cli.tasks.config import compose_task, load
from murmillo.cli.tasks.styles import check_style, style_names, style_weights
from murmillo.cli.tasks.success import StyleSuccess
from murmillo.cli.tasks.world import World
from murmillo.envs import EnvConfig, HumanoidVectorEnv
from murmillo.envs.character import load_character
from murmillo.envs.motion import MotionLibrary, load_clips
from tests.cli.refusals import assert_refused
from tests.cli.running import rows
from tests.cli.tiny_tasks import TINY_TASK, assert_resumed_as_at_once

Murmillo = Callable[..., tuple[int, str, str]]

STYLES = "precision.skills=[walk_forward,run_forward]"


@pytest.fixture(scope="module")
def commanded(tmp_path_factory: pytest.TempPathFactory, tiny: tuple[str, ...]) -> Path:
    """A folder with a tiny run of CALM, `low`, and its precision training, `high`; only to be read."""
    root, threads = tmp_path_factory.mktemp("precision"), torch.get_num_threads()
    short = ("runner.samples=64", "warm_start.steps=0", "agent.encoder.minibatch=16", "agent.encoder.pool=32")
    assert main(["train", "agent=calm", *tiny, *short, f"run.root={root}", "run.name=low"]) == 0
    words = ("task=direction", f"low={root}/low", *TINY_TASK, STYLES, f"run.root={root}", "run.name=high")
    assert main(["train", *words]) == 0
    torch.set_num_threads(threads)
    return root


@pytest.fixture
def own(commanded: Path, folder: Path) -> Path:
    """A copy of these runs in the working folder; `high` still knows `low` by its first place."""
    return Path(shutil.copytree(commanded, folder / "runs"))


@pytest.fixture(scope="module")
def library() -> MotionLibrary:
    character = load_character()
    return MotionLibrary(load_clips("builtin", character), character)


# --- settings --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", ["direction", "relocation", "path_follow"])
def test_what_precision_training_is(commanded: Path, task: str) -> None:
    config = compose_task([f"task={task}", f"low={commanded}/low"])
    assert config.commands_styles
    assert config.agent.skill
    assert config.runner.reward_weights == {"task": 0.5, "similarity": 0.5}
    assert config.latent_env.terms == ()
    assert (config.precision.samples, config.precision.form) == (1, "cosine")  # at the smoke budget
    assert config.make_task().skill_steps == 150
    assert config.choices["agent"] == "calm"


@pytest.mark.parametrize(("budget", "form"), [("laptop", "cosine"), ("paper", "distance")])
def test_the_form_depends_on_the_budget(commanded: Path, budget: str, form: str) -> None:
    config = compose_task(["task=direction", f"low={commanded}/low", f"budget={budget}"])
    check_settings(config, low_runs.find(config.low))
    assert config.precision.form == form


def test_a_task_without_skills_is_learned_as_ever(commanded: Path) -> None:
    config = compose_task(["task=location", f"low={commanded}/low"])
    assert not config.commands_styles
    assert not config.agent.skill
    assert config.runner.reward_weights == {"task": 1.0}


def test_without_names_the_styles_are_those_that_travel(library: MotionLibrary) -> None:
    ways = ("forward", "backward", "left", "right")
    gaits = {f"{gait}_{way}" for gait in ("walk", "run") for way in ways}
    assert set(style_names((), library)) == {*gaits, "crouch_walk", "shield_charge"}
    still = [clip for clip in library.clips if clip.label in ("guard", "kick")]
    with pytest.raises(CommandError, match=r"precision\.skills=\[\]: no clip .* of guard, kick"):
        style_names((), MotionLibrary(still, library.character))


def test_styles_are_commanded_alike(library: MotionLibrary) -> None:
    weight = style_weights(("run_forward", "crouch_walk"), library)
    assert [library.skills[k] for k in weight.nonzero().flatten()] == ["crouch_walk", "run_forward"]
    assert weight.unique().tolist() == [0.0, 0.5]


def test_a_film_shows_no_style_that_was_not_learned(library: MotionLibrary) -> None:
    check_style("run_forward", ("run_forward",), library)
    with pytest.raises(CommandError, match=r"skill=kick: this run has learned other styles: crouch_walk, run_forward"):
        check_style("kick", ("run_forward", "crouch_walk"), library)


# --- runs ------------------------------------------------------------------------------------------------------------


def test_a_run_leaves_all_that_it_should(commanded: Path) -> None:
    high = commanded / "high"
    assert {"reward/task", "reward/similarity"} <= rows(high)[0].keys()
    for row in rows(high):
        task, similarity, total = (float(row[f"reward/{name}"]) for name in ("task", "similarity", "total"))
        assert 0.0 < similarity < 1.0
        assert total == pytest.approx(0.5 * task + 0.5 * similarity, rel=1e-4)
    meta = json.loads((high / "checkpoints" / "last" / "meta.json").read_text())["values"]
    assert meta["meta/action_dim"] == 64
    assert "walk_forward" in meta["meta/skills"]
    measures = json.loads((high / "measures.json").read_text())
    assert list(measures) == ["untrained", "random", "trained"]
    assert all(-1.0 <= found["heading_cosine"] <= 1.0 for found in measures.values())
    assert all(0.0 <= found["style_success"] <= 1.0 for found in measures.values())
    text = (high / "report.md").read_text()
    for part in ("Steps in the commanded style", "Similarity to the commanded style", "human raters", "| style |"):
        assert part in text


def test_evaluation_tells_the_styles_apart(murmillo: Murmillo, own: Path) -> None:
    status, out, err = murmillo("evaluate", "run=runs/high", "worlds=6", "low=runs/low")
    assert status == 0, err
    assert "Steps in the commanded style" in out
    metrics = json.loads((own / "high" / "evaluation" / "metrics.json").read_text())["metrics"]
    assert "one style an episode" in metrics["task"]["protocols"]
    figures = metrics["styles"]["figures"]
    assert {key.partition(".")[2] for key in figures} == {"walk_forward", "run_forward"}
    all_steps = metrics["task"]["figures"]["style_success"]["values"]["trained"]
    by_style = [figures[f"style_success.{style}"]["values"]["trained"] for style in ("walk_forward", "run_forward")]
    assert sum(part["samples"] for part in by_style) == all_steps["samples"]
    hits = sum(part["value"] * part["samples"] for part in by_style)
    assert hits == pytest.approx(all_steps["value"] * all_steps["samples"])
    status, out, err = murmillo("compare", "runs/high", "out=beside")
    assert status == 0, err
    assert "Share of steps in the commanded style" in (own.parent / "beside" / "comparison.md").read_text()
    assert (own.parent / "beside" / "reward_similarity.png").is_file()


def test_resumed_run_equals_an_uninterrupted_one(murmillo: Murmillo, own: Path) -> None:
    assert_resumed_as_at_once(murmillo, own, "task=direction", STYLES)


def test_a_film_of_a_style(own: Path, folder: Path) -> None:
    if all(gl.why_not(backend) for backend in gl.candidates()):
        pytest.skip("no OpenGL draws on this machine")
    config = own / "high" / "config.yaml"
    config.write_text(config.read_text().replace("width: 640", "width: 64").replace("height: 480", "height: 48"))
    run = [sys.executable, "-m", "murmillo.cli.main", "record", "run=runs/high", "seconds=0.2", "skill=run_forward"]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert count_frames_and_secs(str(own / "high" / "video.mp4"))[0] == 6


# --- the world -------------------------------------------------------------------------------------------------------


def test_the_styles_reach_the_policy_with_their_references(commanded: Path) -> None:
    """The references are encodings of the styles' own motions, and equal however often the world is made."""
    config = load(commanded / "high")
    below = low_runs.find(config.low)
    worlds = [World(config, below, 8) for _ in range(2)]
    try:
        first, second = (world.decisions.latent_terms.reference for world in worlds)  # type: ignore[attr-defined]
        assert torch.equal(first, second)
        env = worlds[0].env
        assert first.shape == (len(env.skills), 1, 64)
        torch.testing.assert_close(first.norm(dim=-1), torch.ones(len(env.skills), 1))
        obs, _ = worlds[0].decisions.reset(seed=3)
        assert {env.skills[k] for k in obs["skill"].tolist()} == {"walk_forward", "run_forward"}
        on_it = first[torch.as_tensor(obs["skill"]), 0]
        similarity = worlds[0].decisions.step(on_it.numpy())[4]["side_rewards"]["similarity"]
        assert similarity.max() == pytest.approx(1.0, abs=1e-4)
    finally:
        for world in worlds:
            world.close()


def test_success_is_the_skill_of_the_nearest_clip() -> None:
    """A clip that is replayed is in its own style throughout, and in no other."""
    env = HumanoidVectorEnv(2, EnvConfig(threads=1))
    try:
        success, library = StyleSuccess(env), env.library
        clip = library.skills.index("run_forward")
        played = [name.name for name in library.clips].index("run_forward")
        times = torch.arange(20, dtype=torch.float64) / 30
        states = library.window(torch.full((20,), played), times, 1)[:, 0].numpy()
        skill = np.array([clip, library.skills.index("kick")])
        success.begin({"state": np.stack([states[0]] * 2), "skill": skill})
        for state in states[1:]:
            success.step({"state": np.stack([state] * 2)})
        assert success.steps().tolist() == [[True] * 19, [False] * 19]
    finally:
        env.close()


# --- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("task=direction", "precision.skills=[run_forwards]"), ("precision.skills=[run_forwards]", "run_forward")),
        (("task=direction", "precision.samples=0"), ("precision.samples=0", "at least 1")),
        (("task=direction", "precision.form=letter"), ("precision.form", "letter", "cosine")),
        (("task=direction", "precision.skills=run"), ("precision.skills", "list")),
        (("task=direction", "precision.weight=2"), ("precision.weight", "no such setting")),
        (("task=location", "precision.samples=4"), ("precision.samples=4", "agent=calm", "direction")),
        (("task=direction", "agent=calm_precision"), ("agent=calm_precision", "agent=calm")),
    ],
)
def test_wrong_words(
    murmillo: Murmillo, commanded: Path, folder: Path, words: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    assert_refused(murmillo("train", f"low={commanded}/low", *TINY_TASK, *words), *parts)
    assert list(folder.iterdir()) == []


def test_styles_over_another_agent(murmillo: Murmillo, trained: Path, folder: Path) -> None:
    words = ("task=direction", *TINY_TASK, "precision.skills=[run_forward]")
    for low in (str(trained), "none"):
        assert_refused(murmillo("train", f"low={low}", *words), "precision.skills=[run_forward]", "agent=calm")
    assert list(folder.iterdir()) == []
