"""Every file of `conf/` composes, and what cannot be is refused by its name."""

import itertools
from importlib.resources import files
from pathlib import Path

import pytest

from murmillo.agents.common.errors import AgentError
from murmillo.cli import config as configuration
from murmillo.cli.agents import AGENTS
from murmillo.cli.checks import check_settings
from murmillo.cli.config import compose_train
from murmillo.cli.errors import CommandError
from murmillo.cli.sweep import combinations


def choices(group: str) -> list[str]:
    return sorted(Path(str(path)).stem for path in files("murmillo.conf").joinpath(group).iterdir())


UNFIT = {"ase": {"no_focal"}, "calm": {"neither", "no_diversity", "no_skill_discovery", "no_focal"}, "case": set()}
"""Ablations of what an agent does not have."""


@pytest.mark.parametrize("agent", choices("agent"))
@pytest.mark.parametrize("budget", choices("budget"))
@pytest.mark.parametrize("ablation", choices("ablation"))
def test_every_combination_of_files_composes(agent: str, budget: str, ablation: str) -> None:
    if ablation in UNFIT[agent]:
        with pytest.raises(CommandError, match=r"ablation=\w+: it sets agent\.\w+, which the chosen agent has not"):
            compose_train([f"agent={agent}", f"budget={budget}", f"ablation={ablation}"])
        return
    config = compose_train([f"agent={agent}", f"budget={budget}", f"ablation={ablation}"])
    assert isinstance(config.agent, AGENTS[agent].config)
    assert config.choices == {"agent": agent, "budget": budget, "ablation": ablation}
    check_settings(config)


def test_all_groups_are_covered() -> None:
    assert choices("agent") == sorted(AGENTS)
    assert choices("budget") == ["laptop", "paper", "smoke"]
    assert choices("ablation") == [
        "neither",
        "no_diversity",
        "no_focal",
        "no_masking",
        "no_skill_discovery",
        "none",
        "residual",
    ]
    known = {f"{agent}_{budget}" for agent in choices("agent") for budget in choices("budget")}
    assert set(choices("agent_budget")) <= known


def test_paper_budget_has_table_2() -> None:
    config = compose_train(["budget=paper"])
    ppo, discriminator, runner = config.agent.ppo, config.agent.discriminator, config.runner
    assert config.num_envs * runner.horizon == 131_072
    assert (ppo.minibatch, discriminator.minibatch) == (16_384, 4096)
    assert (ppo.policy_learning_rate, ppo.value_learning_rate, discriminator.learning_rate) == (2e-5, 2e-5, 2e-5)
    assert ppo.std**2 == pytest.approx(0.0025)
    assert (runner.gamma, runner.lam, ppo.clip) == (0.99, 0.95, 0.2)
    assert (config.agent.latent_dim, config.agent.kappa, config.agent.diversity_weight) == (64, 1.0, 0.01)
    assert (discriminator.gradient_penalty, runner.reward_weights) == (5.0, {"style": 1.0, "skill": 0.5})
    assert config.env.episode_steps == 300


def test_agent_file_agrees_with_its_dataclass() -> None:
    """The paper's numbers stand in `conf/` and in the code; they must not drift apart."""
    for name, kind in AGENTS.items():
        assert compose_train([f"agent={name}", "budget=paper"]).agent == kind.config()


def test_ablations() -> None:
    assert compose_train(["ablation=no_diversity"]).agent.diversity == "none"
    assert compose_train(["ablation=no_diversity"]).agent.skill_discovery is True
    neither = compose_train(["ablation=neither"])
    assert (neither.agent.diversity, neither.agent.skill_discovery) == ("none", False)
    assert neither.runner.reward_weights["skill"] == 0.0
    assert compose_train(["agent=case", "ablation=no_focal"]).agent.focal == "none"
    assert compose_train(["agent=case", "ablation=no_masking"]).agent.discriminator.dropout == 0.0
    residual = compose_train(["ablation=residual"])
    assert (residual.env.residual_force, residual.runner.reward_weights["residual"]) == (50.0, 0.1)


def test_a_budget_has_its_own_values_for_an_agent() -> None:
    paper, smoke = (compose_train(["agent=case", f"budget={budget}"]) for budget in ("paper", "smoke"))
    assert (paper.runner.samples, paper.agent.focal_start, paper.agent.upright_iterations) == (1.5e9, 2500, 15_000)
    assert smoke.agent.focal_start < smoke.runner.samples / (smoke.num_envs * smoke.runner.horizon)
    assert compose_train(["agent=case", "agent.focal_start=7"]).agent.focal_start == 7


def test_top_settings_reach_the_environment() -> None:
    config = compose_train(["motions=some/folder", "threads=3", "agent.window=7"])
    assert (config.env.motions, config.env.threads, config.env.window) == ("some/folder", 3, 7)


@pytest.mark.parametrize(
    ("word", "parts"),
    [
        ("sed=1", ("sed", "seed")),
        ("agnt=ase", ("agnt", "agent")),
        ("agent=as", ("agent=as", "ase")),
        ("budget=huge", ("budget=huge", "laptop, paper, smoke")),
        ("agent.ppo.hiden=[1]", ("agent.ppo.hiden", "hidden")),
        ("hidden=[1]", ("agent.ppo.hidden", "agent.discriminator.hidden")),
        ("agent.skills_embedding=3", ("agent.skills_embedding", "no such setting")),
        ("seed=x", ("seed", "'x'", "an integer")),
        ("agent.ppo.std=wide", ("agent.ppo.std", "'wide'", "a number")),
        ("agent.ppo.hidden=4", ("agent.ppo.hidden", "a list such as [")),
        ("env.fall.contact=floor", ("env.fall.contact", "'floor'", "ground, any")),
        ("env.starts.drop_height=[1,2,3]", ("env.starts.drop_height", "takes 2")),
        ("agent.skill_reward=x", ("agent.skill_reward", "log_q")),
        ("run=3", ("run:", "group")),
        ("seed=1,2", ("seed=1,2", "--multirun")),
        ("+agent.extra=1", ("agent.extra", "no such setting")),
        ("~seed", ("~seed", "name=value")),
        ("word", ("word", "name=value")),
        ("run.name=a=b=[", ("run.name", "name=value")),
        ("runner.reward_weights.task=1", ("+runner.reward_weights.task",)),
    ],
)
def test_a_wrong_word_is_named_in_one_line(word: str, parts: tuple[str, ...]) -> None:
    with pytest.raises((CommandError, AgentError)) as caught:
        compose_train([word])
    message = str(caught.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["num_envs=0"], ("num_envs=0", "at least 1")),
        (["num_envs=4", "runner.horizon=8", "agent.ppo.minibatch=33"], ("agent.ppo.minibatch=33", "32 samples")),
        (["env.window=3"], ("env.window=3", "agent.window=10")),
        (["env.autoreset=next_step"], ("env.autoreset=next_step", "same_step")),
        (["threads=-1"], ("threads=-1",)),
        (["seed=-1"], ("seed=-1", "from 0")),
        (["warm_start.steps=-1"], ("warm_start.steps=-1", "at least 0")),
        (["runner.max_minutes=-1"], ("runner.max_minutes=-1", "at least 0")),
        (["agent.discriminator.updates=0"], ("agent.discriminator.updates=0", "at least 1")),
        (["runner.gamma=2"], ("runner.gamma=2", "0 to 1")),
        (["agent.ppo.hidden=[]"], ("agent.ppo.hidden=[]", "each layer")),
        (["agent=calm", "agent.encoder.hidden=[8,0]"], ("agent.encoder.hidden=[8,0]", "each layer")),
        (["+runner.reward_weights.residual=0.1"], ("runner.reward_weights.residual=0.1", "env.residual_force")),
        (["+runner.reward_weights.tracking=2"], ("runner.reward_weights.tracking=2", "env.tracking.follow=true")),
        (["guided_start.rounds=2"], ("guided_start.rounds=2", "env.tracking.follow=true")),
        (["agent.critic_progress=true"], ("agent.critic_progress=true", "env.tracking.follow=true")),
        (["agent.critic_progress=true", "env.tracking.follow=true"], ("nothing uses the clips", "guided_start.rounds")),
        (
            ["env.tracking.follow=true"],
            ("env.tracking.follow=true", "+runner.reward_weights.tracking=3", "guided_start.rounds"),
        ),
    ],
)
def test_an_impossible_combination_is_refused(words: list[str], parts: tuple[str, ...]) -> None:
    with pytest.raises((CommandError, AgentError)) as caught:
        check_settings(compose_train(words))
    for part in parts:
        assert part in str(caught.value)


def test_a_minibatch_as_large_as_the_batch_is_fine() -> None:
    check_settings(compose_train(["num_envs=4", "runner.horizon=8", "agent.ppo.minibatch=32"]))


def test_saved_settings_load_again(tmp_path: Path) -> None:
    config = compose_train(["agent.ppo.hidden=[3,4]", "seed=7", "ablation=neither", "+runner.reward_weights.task=0.2"])
    configuration.save(config, tmp_path)
    assert configuration.load(tmp_path) == config
    assert configuration.load(tmp_path, ["runner.samples=9"]).runner.samples == 9


def test_settings_of_another_version_are_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text("seeed: 3\nchoices: {agent: ase}\n")
    with pytest.raises(CommandError, match=r"config\.yaml: seeed: there is no such setting; did you mean seed"):
        configuration.load(tmp_path)
    for text in ("", "- a\n", "choices: 3\n", "choices: {agent: pose}\n"):
        (tmp_path / "config.yaml").write_text(text)
        with pytest.raises(CommandError, match=r"config\.yaml: choices\.agent: is none of ase, case, calm"):
            configuration.load(tmp_path)
    (tmp_path / "config.yaml").write_text("a: [\n")
    with pytest.raises(CommandError, match=r"config\.yaml: no configuration that can be read"):
        configuration.load(tmp_path)


def test_combinations_of_a_sweep() -> None:
    assert list(combinations(["seed=1,2", "budget=smoke", "agent.window=range(3,5)", "hydra.verbose=true"])) == list(
        itertools.product(("seed=1", "seed=2"), ("budget=smoke",), ("agent.window=3", "agent.window=4"))
    )
