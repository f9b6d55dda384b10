"""Adaptations of ASE, CALM and C·ASE from the command to the report, and what the other commands make of them."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import pytest
import torch

from murmillo.agents.common import checkpoint
from murmillo.agents.common.adapter import AdaptedPolicy
from murmillo.cli import bases, gl, merging, play, runs
from murmillo.cli import config as configuration
from murmillo.cli.agents import load_player, load_untrained, make_agent
from murmillo.cli.bases import TARGETS, compose_adaptation
from murmillo.cli.blending import Blend, load_blended
from murmillo.cli.checks import check_settings
from murmillo.cli.errors import CommandError
from murmillo.cli.main import main
from murmillo.envs import HumanoidVectorEnv
from tests.cli.refusals import assert_refused
from tests.cli.running import rows
from tests.cli.tiny_tasks import TINY_TASK

Murmillo = Callable[..., tuple[int, str, str]]
CLIPS = "clips=[walk_forward,run_forward,slash_down]"
SHORT = ("runner.samples=128", "threads=1", "run.measured_worlds=2", "run.video=false", "run.evaluate=false")
QUICK = ("agent.ppo.policy_learning_rate=1e-2", "env.terrain.tiles=2")


@pytest.fixture(scope="module")
def adapted(tmp_path_factory: pytest.TempPathFactory, tiny: tuple[str, ...]) -> Path:
    """A folder with a tiny run of C·ASE, `base`, and adaptations of it, `ice` and `hills`; only to be read."""
    root, threads = tmp_path_factory.mktemp("adapted"), torch.get_num_threads()
    words = ("agent=case", "runner.samples=64", "agent.upright_iterations=9", CLIPS)
    assert main(["train", *tiny, *words, f"run.root={root}", "run.name=base"]) == 0
    for to, name in (("friction", "ice"), ("terrain", "hills")):
        where = ("train", f"base={root}/base", f"to={to}", *SHORT, f"run.root={root}", f"run.name={name}")
        assert main([*where, *QUICK]) == 0
    torch.set_num_threads(threads)
    return root


@pytest.fixture
def own(adapted: Path, folder: Path) -> Path:
    """A copy of these runs in the working folder; the adaptations still say where their base was at first."""
    return Path(shutil.copytree(adapted, folder / "runs"))


# --- composing -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("to", TARGETS)
def test_all_that_is_not_said_is_the_bases(adapted: Path, to: str) -> None:
    base = configuration.load(adapted / "base")
    config = compose_adaptation([f"base={adapted}/base", f"to={to}", "+env.body.length.left_foot=1.1", "seed=5"])
    check_settings(config)
    assert config.choices == {**base.choices, "to": to}
    assert config.agent.ppo == base.agent.ppo
    assert (config.num_envs, config.runner, config.env.clips) == (8, base.runner, base.env.clips)
    assert (config.seed, config.warm_start.steps, config.agent.injection_penalty) == (5, 0, 0.0)
    assert config.agent.upright_iterations == 0  # the base has been through it
    assert config.run == configuration.RunConfig()
    changed = {
        "friction": config.env.friction == (0.15, 0.15),
        "terrain": config.env.terrain.kind == "mixed",
        "body": config.env.body.shape == "LongThighs",
        "pushes": config.env.pushes.every == (60, 120),
    }
    assert [name for name, is_so in changed.items() if is_so] == [to]
    assert config.env.body.length == {"left_foot": 1.1}
    assert files("murmillo.conf.adaptnet").joinpath("to", f"{to}.yaml").is_file()


def test_what_follows_from_other_settings_follows_again(adapted: Path) -> None:
    words = [f"base={adapted}/base", "to=friction", "env.friction=[0.3,0.5]"]
    config = compose_adaptation([*words, "motions=elsewhere", "threads=2"])
    assert (config.env.motions, config.env.clips, config.env.threads) == ("elsewhere", (), 2)
    assert config.env.friction == (0.3, 0.5)
    assert compose_adaptation([*words, "clips=[run_forward]"]).env.clips == ("run_forward",)


def test_a_joint_may_be_locked_too(adapted: Path) -> None:
    """The right knee is one of 31 actions; the policy goes on seeing it."""
    words = ["env.body.shape=''", "env.body.locked=[right_knee]"]
    config = compose_adaptation([f"base={adapted}/base", "to=body", *words])
    env = HumanoidVectorEnv(2, config.env)
    try:
        base, origin = bases.adapted(config, env)
        assert base is not None
        assert base.actions == 30
        assert origin["base"] == str(adapted / "base")
        agent, _ = make_agent("case", config.agent, env, 1, base=base)
        obs = {name: torch.as_tensor(value) for name, value in env.reset(seed=3)[0].items()}
        assert agent.act(obs).action.shape == (2, 30)
    finally:
        env.close()


# --- runs ------------------------------------------------------------------------------------------------------------


def test_a_run_leaves_all_that_it_should(adapted: Path) -> None:
    base = json.loads((adapted / "base" / "checkpoints" / "last" / "meta.json").read_text())["values"]
    for name, heights in (("ice", False), ("hills", True)):
        run = adapted / name
        assert [row["samples"] for row in rows(run)] == ["64", "128"]
        assert {"ppo/injection", "ppo/decay", "ppo/diversity"} <= rows(run)[0].keys()
        assert list(json.loads((run / "measures.json").read_text())) == ["untrained", "trained"]
        text = (run / "report.md").read_text()
        assert "was adapted to `" in text
        assert "that row is the base" in text
        meta = json.loads((run / "checkpoints" / "last" / "meta.json").read_text())["values"]
        assert (meta["meta/adapted"], meta["meta/heights"]) == (True, heights)
        assert meta["meta/base"] == str(adapted / "base")
        assert len(meta["meta/base_digest"]) == 64
    assert "meta/adapted" not in base
    assert "that row is the base" not in (adapted / "base" / "report.md").read_text()


def test_an_adaptation_begins_as_its_base_and_stays_in_its_checkpoint(own: Path) -> None:
    """Also where the base is gone."""
    config = configuration.load(own / "ice")
    shutil.rmtree(own / "base")
    env = HumanoidVectorEnv(4, config.env)
    try:
        made_of = ("case", config.agent, env, config.seed, own / "ice" / runs.LAST)
        player, before = load_player(*made_of), load_untrained(*made_of)
        assert isinstance(player.model.policy, AdaptedPolicy)
        obs = {name: torch.as_tensor(value) for name, value in env.reset(seed=3)[0].items()}
        latent = player.draw_latents(1)[0]
        actions = []
        for agent in (player, before):
            agent.follow(latent)
            actions.append(agent.act(obs, deterministic=True).action)
        assert (actions[0] - actions[1]).abs().max() > 1e-4
        told = before.condition(latent.expand(4, -1), obs["skill"])
        policy = before.model.policy
        views = before.model.state_normalizer(obs["state"])
        assert torch.equal(actions[1], policy.base(views[:, :120], told))
    finally:
        env.close()


def test_resumed_run_equals_an_uninterrupted_one(murmillo: Murmillo, own: Path, adapted: Path) -> None:
    """The resumed one asks for its base no more."""
    more = ("runner.samples=192", "run.measured_worlds=1")
    words = ("base=runs/base", "to=terrain", *SHORT, *QUICK)
    status, _, err = murmillo("train", *words, *more, "run.name=whole")
    assert status == 0, err
    shutil.rmtree(own / "base")
    config = (own / "hills" / "config.yaml").read_text().replace(str(adapted), "moved")
    (own / "hills" / "config.yaml").write_text(config)
    status, _, err = murmillo("train", "run.resume=runs/hills", *more)
    assert status == 0, err
    resumed, at_once = rows(own / "hills")[-1], rows(own / "whole")[-1]
    assert resumed.pop("samples_per_second")
    assert at_once.pop("samples_per_second")
    assert resumed == at_once
    meta = json.loads((own / "hills" / "checkpoints" / "last" / "meta.json").read_text())["values"]
    assert meta["meta/base"] == str(adapted / "base")


def test_several_runs_of_ase(murmillo: Murmillo, own_run: Path, folder: Path) -> None:
    words = ("base=runs/tiny", "to=body,pushes", *SHORT, "run.root=many", "runner.samples=64")
    status, _, err = murmillo("train", "--multirun", *words)
    assert status == 0, err
    assert {run.name[20:] for run in (folder / "many").iterdir()} == {"ase-body-smoke-1-0", "ase-pushes-smoke-1-1"}


def test_an_adapted_calm(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...]) -> None:
    assert murmillo("train", "agent=calm", *tiny, "run.name=base", "runner.samples=64")[0] == 0
    words = ("base=runs/base", "to=friction", *SHORT, "run.name=ice", "runner.samples=64")
    assert murmillo("train", *words)[0] == 0
    measures = [json.loads((folder / "runs" / name / "measures.json").read_text()) for name in ("base", "ice")]
    base, ice = (measure["trained"]["concentration"] for measure in measures)
    assert base == ice  # it encodes motions as its base does


def test_evaluation_and_comparison(murmillo: Murmillo, own: Path, folder: Path) -> None:
    asked = ("worlds=2", "trajectories=4", "metrics=quality")
    status, out, err = murmillo("evaluate", "run=runs/hills", *asked)
    assert status == 0, err
    assert "commanded skill's head" in out
    assert "the *untrained* policy is that one" in (own / "hills" / "evaluation.md").read_text()
    status, _, err = murmillo("compare", "runs/ice", "runs/hills", "out=beside")
    assert status == 0, err
    page = (folder / "beside" / "comparison.md").read_text()
    assert "friction" in page
    assert "terrain" in page


def test_a_task_over_an_adaptation_is_in_its_world(murmillo: Murmillo, own: Path) -> None:
    words = ("task=location", "low=runs/hills", *TINY_TASK, "run.name=high")
    status, _, err = murmillo("train", *words)
    assert status == 0, err
    assert "kind: mixed" in (own / "high" / "config.yaml").read_text()
    assert_refused(murmillo("train", *words, "env.terrain.kind=flat"), "env.terrain.kind=flat", "which it sees", "drop")
    assert_refused(
        murmillo("train", "task=location", "low=runs/ice", *TINY_TASK, "env.terrain.kind=rough"),
        "env.terrain.kind=rough",
        "without seeing the ground",
    )


def test_play_and_film(own: Path) -> None:
    session = play._open_agent(own / "hills", play.AgentPlayConfig(str(own / "hills"), alpha=0.25))
    try:
        assert session.env.config.terrain.kind == "mixed"
        assert session.adapted is not None
        assert (session.adapted.adapters, session.adapted.alpha) == (1, 0.25)
        session.blend(0.5)
        assert session.adapted.alpha == 0.5
        session.step()
    finally:
        session.env.close()
    if all(gl.why_not(backend) for backend in gl.candidates()):
        pytest.skip("no OpenGL draws on this machine")
    words = ("record", "run=runs/hills", "seconds=0.1", "skill=run_forward", "alpha=0.5")
    done = subprocess.run([sys.executable, "-m", "murmillo.cli.main", *words], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (own / "hills" / "video.mp4").is_file()


# --- blended and merged -----------------------------------------------------------------------------------------------


def actions(runs_of: list[tuple[Path, Blend]]) -> list[torch.Tensor]:
    """Likeliest actions of such runs under one latent and all labels, in the world of the first."""
    first = configuration.load(runs_of[0][0])
    env = HumanoidVectorEnv(6, first.env)
    try:
        obs = {name: torch.as_tensor(value) for name, value in env.reset(seed=3)[0].items()}
        obs["skill"] = torch.arange(6) % 3
        latent, found = torch.nn.functional.normalize(torch.ones(first.agent.latent_dim), dim=0), []
        for run, blend in runs_of:
            agent = load_blended(configuration.load(run), env, run / runs.LAST, blend)
            agent.follow(latent)
            found.append(agent.act(obs, deterministic=True).action)
        return found
    finally:
        env.close()


def test_alpha_goes_from_the_base_to_the_last_bit(adapted: Path) -> None:
    ice, base = adapted / "ice", adapted / "base"
    told = [(ice, Blend()), (ice, Blend(1.0)), (ice, Blend(0.0)), (base, Blend()), (ice, Blend(0.3, str(ice)))]
    asis, whole, none, own, twice = actions(told)
    assert torch.equal(none, own)
    assert torch.equal(whole, asis)
    assert (whole - own).abs().max() > 1e-4
    torch.testing.assert_close(twice, asis, atol=1e-5, rtol=0.0)


def test_a_blend_is_measured_apart(murmillo: Murmillo, own: Path) -> None:
    asked = ("worlds=2", "trajectories=1", "metrics=quality")
    status, out, err = murmillo("evaluate", "run=runs/hills", *asked, "alpha=0.5")
    assert status == 0, err
    place = own / "hills" / "blends" / "alpha=0.5"
    assert f"{place.relative_to(own.parent)}/evaluation.md" in out
    assert "Of its adapter 0.5 acts" in (place / "evaluation.md").read_text()
    results = json.loads((place / "evaluation" / "metrics.json").read_text())
    assert results["blend"] == {"alpha": 0.5, "with": None, "with_checkpoint": None}
    assert not (own / "hills" / "evaluation").exists()


def test_a_merged_run_is_a_run_like_any_other(murmillo: Murmillo, own: Path, adapted: Path) -> None:
    status, out, err = murmillo("merge", "run=runs/hills", "into=runs/one", "worlds=2")
    assert status == 0, err
    assert "runs/one: runs/hills as one network" in out
    assert sorted(path.name for path in own.iterdir()) == ["base", "hills", "ice", "one"]
    for name in ("scalars.csv", "versions.json", "skills.json", "clips.json", "terms.json"):
        assert (own / "one" / name).read_bytes() == (own / "hills" / name).read_bytes(), name
    assert "which learns no more" in (own / "one" / "report.md").read_text()
    assert "run.resume" not in (own / "one" / "report.md").read_text()
    meta, was = (checkpoint.load(own / name / runs.LAST)["meta"] for name in ("one", "hills"))
    merged = meta.pop("merged")
    assert (merged["run"], merged["base"]) == ("runs/hills", str(adapted / "base"))
    assert {**meta, "base": was["base"], "base_digest": merged["base_digest"]} == was
    shutil.rmtree(own / "base")
    theirs, ours = actions([(own / "hills", Blend()), (own / "one", Blend())])
    torch.testing.assert_close(ours, theirs, atol=1e-5, rtol=0.0)
    status, _, err = murmillo("evaluate", "run=runs/one", "worlds=2", "trajectories=1", "metrics=quality")
    assert status == 0, err
    assert "It adapts" not in (own / "one" / "evaluation.md").read_text()
    assert murmillo("compare", "runs/hills", "runs/one", "out=beside")[0] == 0
    assert murmillo("train", "task=location", "low=runs/one", *TINY_TASK, "run.name=high")[0] == 0
    for words, part in (
        (
            ("train", "run.resume=runs/one", "runner.samples=999"),
            "run.resume=runs/one: this run was merged of runs/hil",
        ),
        (("train", "base=runs/one", "to=friction"), "base=runs/one: this run adapts a policy itself"),
        (("merge", "run=runs/one", "into=runs/two"), "run=runs/one: this run is merged already, of runs/hills"),
        (("evaluate", "run=runs/one", "alpha=0.5"), "alpha=0.5: a policy without adapters cannot be blended"),
    ):
        assert_refused(murmillo(*words), part)


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("run=runs/ice",), ("into", "needed")),
        (("run=runs/gone", "into=runs/new"), ("run=runs/gone", "no such run")),
        (("run=runs/base", "into=runs/new"), ("run=runs/base", "adapts no other")),
        (("run=runs/ice", "into=runs/base"), ("into=runs/base", "already")),
        (("run=runs/ice", "into=gone/new"), ("into=gone/new", "no folder gone")),
        (("run=runs/ice", "into=runs/.new"), ("into=runs/.new", "letters")),
        (("run=runs/ice", "into=runs/new", "alpha=1.2"), ("alpha=1.2", "between")),
        (("run=runs/ice", "into=runs/new", "worlds=-1"), ("worlds=-1", "0 for none")),
        (("run=runs/ice", "into=runs/new", "base=runs/base"), ("base=runs/base", "drop this")),
        (("run=runs/ice", "into=runs/new", "with=runs/base"), ("with=runs/base", "cannot be joined")),
        (("run=runs/ice", "into=runs/new", "with=runs/hills"), ("with=runs/hills", "heights")),
    ],
)
def test_what_cannot_be_merged(murmillo: Murmillo, own: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    before = sorted(own.iterdir())
    assert_refused(murmillo("merge", *words), *parts)
    assert sorted(own.iterdir()) == before


def test_nothing_is_left_of_a_merging_that_failed(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    adaptation, before = merging.open_adaptation(str(own / "ice")), sorted(own.iterdir())
    monkeypatch.setattr(merging, "TOLERANCE", -1.0)
    with pytest.raises(CommandError, match=r"merged, its actions would differ by .* it stays as it is"):
        merging.save(adaptation, Blend(), own / "new")
    assert sorted(own.iterdir()) == before


def test_two_methods_do_not_go_together(murmillo: Murmillo, own: Path) -> None:
    config = (own / "hills" / "config.yaml").read_text()
    (own / "hills" / "config.yaml").write_text(config.replace("agent: case", "agent: ase"))
    asked = ("run=runs/ice", "with=runs/hills", "alpha=0.5")
    for command in ("record", "evaluate"):
        assert_refused(murmillo(command, *asked), "with=runs/hills", "a run of ase, the other one of case")


# --- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("to=friction",), ("to=friction: of which policy?", "base=runs/<name>")),
        (("base=null", "to=friction"), ("of which policy?",)),
        (("base=runs/base",), ("base=runs/base: adapted to what?", "friction, terrain, body, pushes")),
        (("base=runs/base", "to=style"), ("to=style", "a policy of case cannot", "friction")),
        (("base=runs/base", "to=frction"), ("to=frction", "did you mean friction")),
        (("base=runs/gone", "to=friction"), ("base=runs/gone", "no such run", "base")),
        (("base=runs/ice", "to=pushes"), ("base=runs/ice", "adapts a policy itself", "/base")),
        (("agent=ase", "base=runs/base", "to=friction"), ("agent=ase", "is a run of case", "leave it out")),
        (("agent=adaptnet", "stage=adapt", "base=runs/base", "to=friction"), ("base=runs/base", "no run of agent=ada")),
        (("base=runs/base", "to=friction", "budget=laptop"), ("budget=laptop", "its base's", "runner.samples=")),
        (("base=runs/base", "to=friction", "ablation=no_focal"), ("ablation=no_focal", "its base's")),
        (
            ("base=runs/base", "to=friction", "env.character=humanoid"),
            ("env.character=humanoid", "sword_shield", "drop"),
        ),
        (("base=runs/base", "to=friction", "env.residual_force=50"), ("env.residual_force=50", "0.0", "drop")),
        (("base=runs/base", "to=friction", "agent.window=5"), ("agent.window=5", "trained with 10", "drop")),
        (("base=runs/base", "to=friction", "agent.ppo.hidden=[9]"), ("agent.ppo.hidden=[9]", "[16]", "drop")),
        (("base=runs/base", "to=friction", "clips=[run_forward]"), ("base=runs/base", "skills is", "keep its clips")),
        (("base=runs/base", "to=friction", "warm_start.steps=3"), ("warm_start.steps=3", "its base can do")),
        (("base=runs/base", "to=friction", "agent.adapter.injection=[7]"), ("agent.adapter.injection=[7]", "0 to 1")),
        (("base=runs/base", "to=friction", "agent.injection_penalty=-1"), ("agent.injection_penalty=-1", "0 or more")),
        (("base=runs/base", "to=friction", "env.frction=[1,1]"), ("env.frction", "did you mean friction")),
        (("base=runs/base", "to=body", "env.body.shape=LongThigs"), ("LongThigs", "LongThighs")),
        (("base=runs/base", "to=body", "+env.body.length.sward=2"), ("body.length.sward", "sword")),
        (("agent=case", "agent.adapter.rank=3"), ("agent.adapter", "base=runs/<name>")),
    ],
)
def test_wrong_words(murmillo: Murmillo, own: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    assert_refused(murmillo("train", *words, *SHORT, "run.name=new"), *parts)
    assert not (own / "new").exists()


def test_what_is_no_base(murmillo: Murmillo, own: Path) -> None:
    for kind, said in (("task: location\n  agent: case", "has learned a task"), ("agent: adaptnet", "stage=adapt")):
        (own / "other").mkdir(exist_ok=True)
        (own / "other" / "config.yaml").write_text(f"choices:\n  {kind}\n")
        assert_refused(murmillo("train", "base=runs/other", "to=friction"), "base=runs/other", said)
    tensors = own / "base" / "checkpoints" / "last" / "tensors.safetensors"
    tensors.write_bytes(tensors.read_bytes()[:99])
    assert_refused(murmillo("train", "base=runs/base", "to=friction", *SHORT), "base=runs/base", "is damaged")
    shutil.rmtree(own / "base" / "checkpoints")
    assert_refused(murmillo("train", "base=runs/base", "to=friction"), "base=runs/base", "has no checkpoint")
