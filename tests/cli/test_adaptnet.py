"""AdaptNet from the command to the report: a base, adaptations of it, their films, figures and maps."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import torch
from imageio_ffmpeg import count_frames_and_secs

from murmillo.agents.adaptnet.agent import AdaptNet
from murmillo.agents.adaptnet.config import AdaptNetConfig
from murmillo.cli import gl
from murmillo.cli.adaptation.checks import check_settings
from murmillo.cli.adaptation.config import TARGETS, AdaptNetTrainConfig, compose_adaptnet
from murmillo.cli.adaptation.latents import latent
from murmillo.cli.adaptation.measuring import piece_errors
from murmillo.cli.adaptation.published import imitation_error
from murmillo.cli.adaptation.world import load_agent, load_blended, make_agent, make_env, open_run
from murmillo.cli.blending import Blend
from murmillo.cli.errors import CommandError
from murmillo.cli.main import main
from murmillo.envs.character import load_character
from murmillo.envs.motion import load_clips, save_clips
from murmillo.envs.motion.editing import trim
from tests.cli.refusals import assert_refused
from tests.cli.running import rows

Murmillo = Callable[..., tuple[int, str, str]]

TINY = (
    "num_envs=4",
    "runner.horizon=4",
    "runner.samples=32",
    "agent.ppo.minibatch=8",
    "agent.ppo.epochs=1",
    "agent.discriminator.recurrent=8",
    "agent.discriminator.hidden=[16]",
    "agent.discriminator.heads=4",
    "agent.discriminator.minibatch=8",
    "threads=1",
    "env.episode_steps=80",
    "env.width=64",
    "env.height=48",
    "run.measured_worlds=2",
    "run.video=false",
)
"""Two iterations."""
SIZES = ("agent.recurrent=8", "agent.ppo.hidden=[80,72]", "warm_start.steps=2", "warm_start.pairs=64")
"""Of a base; an adaptation takes them over."""


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a tiny base, `base`, and adaptations of it, `style` and `slippery`; only to be read."""
    root, threads = tmp_path_factory.mktemp("adaptnet"), torch.get_num_threads()
    assert main(["train", "agent=adaptnet", *TINY, *SIZES, "task.turn=75", f"run.root={root}", "run.name=base"]) == 0
    adapt = ("train", "agent=adaptnet", "stage=adapt", f"base={root}/base", *TINY, f"run.root={root}")
    assert main([*adapt, "to=style", "run.name=style"]) == 0
    assert main([*adapt, "to=friction", "agent.ppo.policy_learning_rate=1e-2", "run.name=slippery"]) == 0
    torch.set_num_threads(threads)
    return root


@pytest.fixture
def own(trained: Path, folder: Path) -> Path:
    """A copy of these runs in the working folder; the adaptations still know the base by its first place."""
    return Path(shutil.copytree(trained, folder / "runs"))


def adapting(trained: Path, *words: str) -> AdaptNetTrainConfig:
    return compose_adaptnet(["agent=adaptnet", "stage=adapt", f"base={trained}/base", *words])


# --- composing -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("budget", ["smoke", "laptop", "paper"])
def test_every_budget_composes(budget: str) -> None:
    config = compose_adaptnet(["agent=adaptnet", f"budget={budget}", "task.gait=run"])
    check_settings(config, None)
    assert config.choices["budget"] == budget
    runner = config.runner
    assert (runner.gamma, runner.lam, runner.horizon, runner.termination_reward) == (0.95, 0.95, 8, -25.0)
    assert runner.reward_weights == {"task": 0.5, "imitation": 0.5}
    assert (config.num_envs, config.env.clips) == (512, ("run",))
    assert config.task.turn == (180.0 if budget == "paper" else 60.0)
    if budget == "paper":
        assert config.agent == AdaptNetConfig()
        assert runner.samples == 100_000 * 512 * 8


def test_every_file_of_the_groups_is_reached(trained: Path) -> None:
    """One composition after the other, until each file has been in one."""
    names = {group: _files(group) for group in ("to", "method", "ablation")}
    for number in range(max(map(len, names.values()))):
        chosen = {group: known[number % len(known)] for group, known in names.items()}
        config = adapting(trained, *(f"{group}={name}" for group, name in chosen.items()), "budget=laptop")
        assert config.choices == {"agent": "adaptnet", "stage": "adapt", "budget": "laptop", **chosen}
        # what is the base's stays the base's
        assert (config.agent.recurrent, config.agent.ppo.hidden) == (8, (80, 72))
        assert (config.warm_start.steps, config.task.turn) == (0, 75.0)
    assert set(names["to"]) == set(TARGETS)
    assert set(names["ablation"]) >= {"injection_z1", "injection_z2", "injection_all", "internal_only", "lora"}


def _files(group: str) -> list[str]:
    files_of_it = files("murmillo.conf.adaptnet").joinpath(group).iterdir()
    return sorted({Path(str(path)).stem for path in files_of_it} - ({"none"} if group == "to" else set()))


def test_what_an_adaptation_is_to_and_by_can_be_changed(trained: Path) -> None:
    config = adapting(trained, "to=style", "method=finetune_regularised", "clips=[limp]", "env.body.locked=[elbows]")
    assert (config.env.clips, config.env.body.locked) == (("limp",), ("elbows",))
    assert (config.agent.method, config.agent.weight_decay) == ("finetune", 1e-4)
    assert adapting(trained, "to=style", "motions=elsewhere").env.clips == ()
    config = adapting(trained, "to=friction", "env.friction=[0.3,0.5]", "ablation=injection_all")
    assert (config.env.clips, config.env.friction) == (("walk",), (0.3, 0.5))
    assert config.agent.adapter.injection == (0, 1, 2)


# --- runs ------------------------------------------------------------------------------------------------------------


def test_a_run_leaves_all_that_it_should(trained: Path) -> None:
    for name in ("base", "style"):
        run = trained / name
        assert [row["samples"] for row in rows(run)] == ["16", "32"]
        assert {"reward/task", "reward/imitation"} <= rows(run)[0].keys()
        measures = json.loads((run / "measures.json").read_text())
        assert list(measures) == ["untrained", "trained"]
        assert all(0.0 <= found["goal_reward"] <= 1.0 for found in measures.values())
        assert all(0 < found["length"] <= 80 for found in measures.values())
        text = (run / "report.md").read_text()
        for part in ("Goal reward", "Imitation reward", "plots/learning_curve.png", "mitation error"):
            assert part in text
    meta = json.loads((trained / "style" / "checkpoints" / "last" / "meta.json").read_text())["values"]
    assert meta["meta/base"] == str(trained / "base")
    assert len(meta["meta/base_digest"]) == 64
    assert (meta["meta/features"], meta["meta/goal_dim"], meta["meta/action_dim"]) == ("links", 4, 28)
    assert not (trained / "base" / "checkpoints" / "warm_started").exists()


def test_an_adaptation_begins_as_its_base_also_with_a_joint_locked(trained: Path) -> None:
    """The right knee is one hinge, and the outputs of all other joints stay."""
    config = adapting(trained, "to=lock")
    base = config.find_base()
    assert base is not None
    env, free = make_env(config, 2), make_env(base.config, 2)
    try:
        (adapted, _), own = make_agent(config, base, env), load_agent(base.config, None, free, base.folder)
        obs = {name: torch.as_tensor(value) for name, value in env.reset(seed=3)[0].items()}
        kept = [action for action in range(28) if action not in env.character.pruned]
        assert len(kept) == 27
        expected = own.act(obs, deterministic=True).action[:, kept]
        # a product with fewer rows may round otherwise
        torch.testing.assert_close(adapted.act(obs, deterministic=True).action, expected, atol=1e-6, rtol=0.0)
    finally:
        env.close()
        free.close()


def test_resumed_run_equals_an_uninterrupted_one(murmillo: Murmillo, own: Path, trained: Path) -> None:
    assert_refused(murmillo("train", "run.resume=runs/style", "seed=2"), "seed=2", "base")
    status, _, err = murmillo("train", "run.resume=runs/style", "runner.samples=48", "run.measured_worlds=1")
    assert status == 0, err
    words = ("stage=adapt", "to=style", "base=runs/base", *TINY, "runner.samples=48", "run.measured_worlds=1")
    status, _, err = murmillo("train", *words, "run.name=whole")
    assert status == 0, err
    resumed, at_once = rows(own / "style")[-1], rows(own / "whole")[-1]
    assert resumed.pop("samples_per_second")
    assert at_once.pop("samples_per_second")
    assert resumed == at_once


def test_the_baselines_train_one_after_the_other(murmillo: Murmillo, own: Path) -> None:
    words = ("stage=adapt", "base=runs/base", "to=body", *TINY, "runner.samples=16", "run.measured_worlds=1")
    status, _, err = murmillo("train", "--multirun", *words, "method=scratch,progressive", "run.root=many")
    assert status == 0, err
    methods = {run.name[20:]: run for run in (own.parent / "many").iterdir()}
    assert set(methods) == {"scratch-body-smoke-1-0", "progressive-body-smoke-1-1"}
    for run in methods.values():
        assert "adapted to `body` by" in (run / "report.md").read_text()
        with pytest.raises(CommandError, match=r"alpha=0\.5: a policy without adapters cannot be blended"):
            player(run, alpha=0.5)


def test_evaluation_and_comparison(murmillo: Murmillo, own: Path) -> None:
    status, out, err = murmillo("evaluate", "run=runs/style", "worlds=3", "base=runs/base")
    assert status == 0, err
    assert "Goal reward" in out
    assert json.loads((own / "style" / "evaluation" / "metrics.json").read_text())["trajectories"] == 3
    assert_refused(murmillo("evaluate", "run=runs/style", "metrics=all"), "metrics", "no such setting")
    status, out, err = murmillo("compare", "runs/style", "runs/slippery", "out=beside")
    assert status == 0, err
    page = (own.parent / "beside" / "comparison.md").read_text()
    assert "Goal reward" in page
    assert (own.parent / "beside" / "reward_task.png").is_file()
    assert (own.parent / "beside" / "reward_imitation.png").is_file()


# --- measures --------------------------------------------------------------------------------------------------------


def test_pieces_of_a_cycle_have_no_error_wherever_they_begin() -> None:
    angle = torch.arange(20) / 20 * 2 * torch.pi
    reference = torch.stack((angle.cos(), angle.sin(), torch.zeros(20)), -1)[:, None]
    motion = reference.roll(-7, 0).repeat(3, 1, 1)[:50]
    assert piece_errors(motion, reference).tolist() == pytest.approx([0.0, 0.0], abs=1e-6)  # the last 10 are too few
    assert piece_errors(motion[:35], reference).tolist() == pytest.approx([0.0, 0.0], abs=1e-6)
    assert piece_errors(motion + torch.tensor([0.0, 0.0, 0.3]), reference).tolist() == pytest.approx([0.3, 0.3])
    assert piece_errors(motion[:14], reference).tolist() == []
    assert piece_errors(motion.flip(0), reference).min() > 0.2


def test_the_papers_figure_is_known_by_the_name_of_the_clip() -> None:
    assert [imitation_error(name) for name in ("jaunty", "Jaunty_skip", "strut", "pace")] == [0.16, 0.16, 0.09, 0.09]
    assert imitation_error("walk") is None
    assert imitation_error("spacewalk") is None


# --- blending, films and maps ----------------------------------------------------------------------------------------


def player(run: Path, **told: Any) -> tuple[AdaptNet, dict[str, torch.Tensor]]:
    """The run's agent with its adapters as was told, and what it sees first."""
    config, base = open_run(run)
    env = make_env(config, 2)
    try:
        agent = load_blended(config, base, env, run, Blend(**told))
        return agent, {name: torch.as_tensor(value) for name, value in env.reset(seed=3)[0].items()}
    finally:
        env.close()


def test_alpha_goes_from_the_base_to_the_adaptation(trained: Path) -> None:
    base, obs = player(trained / "base")
    none, whole = (player(trained / "slippery", alpha=alpha)[0] for alpha in (0.0, 1.0))
    asis, _ = player(trained / "slippery")
    other, _ = player(trained / "style")
    both, _ = player(trained / "slippery", other=str(trained / "style"), alpha=0.0)

    def act(agent: AdaptNet) -> torch.Tensor:
        return agent.act(obs, deterministic=True).action

    # of two rows, a GRU whose weights want no gradient rounds otherwise
    torch.testing.assert_close(act(none), act(base), atol=1e-6, rtol=0.0)
    assert torch.equal(act(whole), act(asis))
    assert (act(whole) - act(base)).abs().max() > 1e-4
    torch.testing.assert_close(act(both), act(other), atol=1e-6, rtol=0.0)
    assert latent(base, obs).shape == (2, 8 + 4)


def test_a_merged_run_needs_no_base(murmillo: Murmillo, own: Path) -> None:
    status, _, err = murmillo("merge", "run=runs/slippery", "into=runs/one", "base=runs/base", "alpha=0.5", "worlds=2")
    assert status == 0, err
    half, obs = player(own / "slippery", alpha=0.5)
    shutil.rmtree(own / "base")
    one, _ = player(own / "one")
    assert one.adapters == 0
    actions = [agent.act(obs, deterministic=True).action for agent in (half, one)]
    torch.testing.assert_close(*actions, atol=1e-5, rtol=0.0)
    assert "runs/slippery alpha=0.5" in (own / "one" / "report.md").read_text()
    assert json.loads((own / "one" / "evaluation" / "metrics.json").read_text())["run"] == "one"
    status, _, err = murmillo("evaluate", "run=runs/one", "worlds=2")
    assert status == 0, err
    assert_refused(murmillo("train", "run.resume=runs/one"), "run.resume=runs/one", "learns no more")
    assert_refused(murmillo("map", "runs/one"), "runs/one", "merged of runs/slippery")


def test_a_blend_is_measured_apart(murmillo: Murmillo, own: Path) -> None:
    before = (own / "style" / "evaluation" / "metrics.json").read_bytes()
    status, out, err = murmillo("evaluate", "run=runs/style", "with=runs/slippery", "worlds=2")
    assert status == 0, err
    place = "runs/style/blends/with=slippery"
    assert f"{place}/evaluation.md" in out
    found = json.loads((own.parent / place / "evaluation" / "metrics.json").read_text())["blend"]
    assert (found["alpha"], found["with"], len(found["with_checkpoint"])) == (None, "runs/slippery", 64)
    assert (own / "style" / "evaluation" / "metrics.json").read_bytes() == before


def test_films(own: Path, folder: Path) -> None:
    if all(gl.why_not(backend) for backend in gl.candidates()):
        pytest.skip("no OpenGL draws on this machine")
    words = ["run=runs/style", "with=runs/slippery", "alpha=0.3", "seconds=0.1", "out=blend.mp4"]
    run = [sys.executable, "-m", "murmillo.cli.main", "record", *words]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert count_frames_and_secs(str(own / "style" / "blend.mp4"))[0] == 3
    assert not list((own / "style").glob(".*"))


def test_a_map_of_latents(murmillo: Murmillo, own: Path) -> None:
    status, out, err = murmillo("map", "runs/base", "runs/style", "points=6", "out=map.png")
    assert status == 0, err
    assert "2 runs" in out
    assert (own.parent / "map.png").stat().st_size > 1000
    assert_refused(murmillo("map", "runs/base", "points=1"), "points=1")
    assert_refused(murmillo("map", "runs/base", "out=map.jpg"), "out=map.jpg", ".png")
    assert_refused(murmillo("map"), "at least one run")


# --- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("stage=adapt", "to=style"), ("stage=adapt", "base=runs/<name>")),
        (("stage=bsae",), ("stage=bsae", "did you mean base")),
        (("agent=adaptnet", "base=runs/base"), ("base=runs/base", "stage=adapt")),
        (("agent=adaptnet", "to=style"), ("to=style", "stage=adapt")),
        (("agent=adaptnet", "method=scratch"), ("method=scratch", "stage=adapt")),
        (("agent=adaptnet", "ablation=lora"), ("ablation=lora", "stage=adapt")),
        (("agent=adaptnet", "env.features=character"), ("env.features=character", "links")),
        (("agent=adaptnet", "env.window=7"), ("env.window=7", "agent.window alone")),
        (("agent=adaptnet", "task.gait=crawl"), ("task.gait", "crawl", "walk")),
        (("agent=adaptnet", "agent.window=1"), ("agent.window=1", "at least 2")),
        (("agent=adaptnet", "budget=larg"), ("budget=larg", "laptop")),
    ],
)
def test_wrong_words(murmillo: Murmillo, folder: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    assert_refused(murmillo("train", *words), *parts)
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("to=stile",), ("to=stile", "style")),
        ((), ("to what", "style")),
        (("to=style", "method=best"), ("method=best", "progressive")),
        (("to=style", "base=runs/style"), ("base=runs/style", "adapts a policy itself")),
        (("to=style", "base=runs/nothing"), ("base=runs/nothing", "no such run")),
        (("to=style", "env.character=sword_shield"), ("env.character=sword_shield", "humanoid")),
        (("to=style", "agent.ppo.hidden=[9]"), ("agent.ppo.hidden=[9]", "[80,72]")),
        (("to=style", "warm_start.steps=5"), ("warm_start.steps=5", "base")),
        (("to=style", "agent.adapter.injection=[7]"), ("agent.adapter.injection=[7]", "0 to 2")),
        (("to=body", "+env.body.thickness.pelvis=2"), ("interpenetrate",)),
        (("to=terrain", "env.terrain.spacing=0.2"), ("spacing=0.2", "coarse")),
    ],
)
def test_wrong_adaptations(murmillo: Murmillo, own: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    assert_refused(murmillo("train", "stage=adapt", "base=runs/base", *TINY, *words, "run.name=new"), *parts)
    assert not (own / "new").exists()


def test_a_style_that_is_too_short(murmillo: Murmillo, own: Path) -> None:
    character = load_character("humanoid")
    (jaunty,) = load_clips("builtin", character, ("jaunty",))
    save_clips("short", [trim(jaunty, 0.0, 0.4)])
    words = ("stage=adapt", "base=runs/base", "to=style", "motions=short", *TINY, "run.name=new")
    assert_refused(murmillo("train", *words), "jaunty", "0.40 s", "0.5 s")
    assert not (own / "new").exists()


def test_another_base(murmillo: Murmillo, own: Path) -> None:
    """One that was trained on is another."""
    assert murmillo("train", "run.resume=runs/base", "runner.samples=48", "run.measured_worlds=1")[0] == 0
    for words in (
        ("evaluate", "run=runs/style", "base=runs/base"),
        ("train", "run.resume=runs/style", "base=runs/base", "runner.samples=48"),
    ):
        assert_refused(murmillo(*words), "base=runs/base", "not the one", "train a new policy")
    assert_refused(murmillo("map", "runs/base", "runs/style"), "runs/style", "its base")
    assert_refused(murmillo("evaluate", "run=runs/style", "base=runs/gone"), "base=runs/gone", "no such run")


@pytest.mark.parametrize("alpha", ["1.5", "-0.1", "nan"])
def test_alpha_outside(murmillo: Murmillo, own: Path, alpha: str) -> None:
    assert_refused(murmillo("record", "run=runs/style", f"alpha={alpha}"), f"alpha={alpha}", "between")


def test_what_the_other_commands_say_of_such_a_run(murmillo: Murmillo, own: Path, trained: Path) -> None:
    assert_refused(murmillo("play", "run=runs/style"), "run=runs/style", "murmillo record")
    assert_refused(murmillo("train", "task=location", "low=runs/base"), "low=runs/base", "ase, calm or case")
    assert_refused(murmillo("map", "runs/base", "runs/gone"), "runs/gone", "no such run")


def test_two_that_do_not_go_together(trained: Path) -> None:
    with pytest.raises(CommandError, match=r"with=.*base.*cannot be joined"):
        player(trained / "style", other=str(trained / "base"))
