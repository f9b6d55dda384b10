"""C·ASE on the toy: the label decides what the policy does, and the discriminator holds the labels apart."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from gymnasium import spaces
from torch import Tensor

from murmillo.agents.case.agent import CASE
from murmillo.agents.case.networks import LabelEmbedding
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.rollout import tensors
from murmillo.agents.common.runner import Runner
from murmillo.agents.common.warm_start import WarmStartConfig, warm_start
from tests.agents.toy import PointMass, make_case, make_runner, small_case

SKILLS = 3


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[CASE, list[dict[str, float]]]:
    """An agent after 30 iterations of 512 samples, and their statistics."""
    history: list[dict[str, float]] = []
    runner = make_runner(
        tmp_path_factory.mktemp("case"),
        make=make_case,
        num_envs=64,
        skills=SKILLS,
        samples=64 * 8 * 30,
        agent={"diversity": "none"},
        reward_weights={"style": 1.0, "skill": 0.1},
    )
    runner.on_iteration = [history.append]
    runner.run()
    assert isinstance(runner.agent, CASE)
    return runner.agent, history


def sector_of_motion(agent: CASE, labels: Tensor, switch: Callable[[Tensor], Tensor] = lambda labels: labels) -> Tensor:
    """In which demonstrations' sector each world moves [64] after 8 steps as commanded, the last 4 under `switch`."""
    env = PointMass(64, episode_steps=99, bound=99.0, skills=SKILLS)
    obs = tensors(env.reset(seed=5)[0])
    agent.reset(torch.arange(64))
    for step in range(12):
        label = labels if step < 8 else switch(labels)
        action = agent.act({**obs, "skill": label}, deterministic=True).action
        obs = tensors(env.step(action.numpy())[0])
    velocity = obs["state"][:, 2:]
    return (torch.atan2(velocity[:, 1], velocity[:, 0]) % (2 * math.pi) * SKILLS / (2 * math.pi)).long()


def test_the_character_does_what_its_label_says(trained: tuple[CASE, list]) -> None:
    labels = torch.arange(64) % SKILLS
    assert (sector_of_motion(trained[0], labels) == labels).float().mean() > 0.7  # chance is a third


def test_the_label_can_be_switched_at_any_step(trained: tuple[CASE, list]) -> None:
    labels = torch.arange(64) % SKILLS
    after = sector_of_motion(trained[0], labels, switch=lambda labels: (labels + 1) % SKILLS)
    assert (after == (labels + 1) % SKILLS).float().mean() > 0.55
    assert (after == labels).float().mean() < 0.3


def test_the_commanded_skills_head_scores_higher_than_the_others(trained: tuple[CASE, list]) -> None:
    last = {name: sum(stats[name] for stats in trained[1][-5:]) / 5 for name in trained[1][0]}
    assert last["heads/agent_right"] > last["heads/agent_other"] + 0.05
    assert last["heads/demonstration_right"] > last["heads/demonstration_other"] + 0.1
    first = trained[1][0]
    assert abs(first["heads/agent_right"] - first["heads/agent_other"]) < 0.05


def test_it_learns_to_move_like_the_demonstrations_and_by_its_latent(trained: tuple[CASE, list]) -> None:
    first, last = trained[1][0], trained[1][-1]
    assert last["reward/task"] > first["reward/task"] + 0.15
    assert last["reward/skill"] > first["reward/skill"] + 0.1


def test_shares_and_scores_of_the_skills_are_told(trained: tuple[CASE, list]) -> None:
    tables = trained[0].skill_tables()
    assert tables["share"].sum().item() == pytest.approx(1.0)
    assert not torch.allclose(tables["share"], torch.full((SKILLS,), 1 / SKILLS), atol=1e-4)
    assert ((tables["score"] > 0.2) & (tables["score"] < 0.8)).all()


def small_runner(folder: Path, iterations: int) -> Runner:
    agent = {"upright_iterations": 2, "focal_start": 2, "focal": "normalised"}
    return make_runner(folder, make=make_case, skills=SKILLS, agent=agent, samples=iterations * 32 * 8)


def test_curriculum_and_focal_sampling_reach_the_environment(tmp_path: Path) -> None:
    runner = small_runner(tmp_path, 4)
    env, agent = runner.env, runner.agent
    assert isinstance(env, PointMass)
    assert isinstance(agent, CASE)
    ground, weights = [], []

    def told(stats: dict[str, float]) -> None:
        ground.append(env.ground_contact)
        weights.append(env.skill_weights)

    runner.on_iteration = [told]
    runner.run()
    assert ground == [False, False, True, True]
    assert torch.equal(
        weights[2], torch.full((SKILLS,), 1 / SKILLS)
    )  # the third iteration is the first that moves them
    assert not torch.equal(weights[3], weights[2])
    assert small_case().focal != "none"
    assert make_case(PointMass(3), torch.Generator(), focal="none").directions() == {}


def test_where_steps_are_shared_out_new_episodes_are_commanded_so(generator: torch.Generator) -> None:
    agent = make_case(PointMass(3, skills=SKILLS), generator, focal="none", focal_steps=True)
    agent.focal.update(torch.full((4,), 0.5), torch.tensor([0, 0, 0, 1]))
    weights = agent.directions()["skill_weights"]
    assert torch.equal(weights, agent.focal.commanded)
    assert weights[0] < weights[1]


def test_demonstrations_are_drawn_by_the_shares_of_their_skills(generator: torch.Generator) -> None:
    agent = make_case(PointMass(3, skills=SKILLS), generator)
    agent.focal.probability = torch.tensor([0.0, 0.9, 0.1])
    drawn = agent._draw_demonstrations()
    assert drawn.condition is not None
    assert drawn.condition.bincount(minlength=SKILLS)[1] > 0.75 * len(drawn.condition)
    assert not (drawn.condition == 0).any()


def test_scores_of_the_heads_by_hand(generator: torch.Generator) -> None:
    agent = make_case(PointMass(3, skills=SKILLS), generator)
    window, label = torch.randn(5, 3, 4, generator=generator), torch.tensor([0, 1, 2, 0, 1])
    each = torch.stack([agent.discriminator.logits(window, torch.full((5,), c)) for c in range(SKILLS)], 1).sigmoid()
    scores = agent._heads(agent._agent_windows(window, label))
    commanded = label[:, None] == torch.arange(SKILLS)
    torch.testing.assert_close(scores["right"], each[commanded])
    torch.testing.assert_close(scores["other"], each[~commanded].view(5, SKILLS - 1).mean(1))


def test_the_encoder_is_told_the_label(generator: torch.Generator) -> None:
    agent = make_case(PointMass(3, skills=SKILLS), generator)
    mu = agent.encoder(torch.ones(SKILLS, 12), torch.arange(SKILLS))
    torch.testing.assert_close(mu.norm(dim=1), torch.ones(SKILLS))
    assert ((mu[1:] - mu[:1]).norm(dim=1) > 0.01).all()


def test_an_environment_that_cannot_be_directed_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(PointMass, "set_skill_weights")
    with pytest.raises(AgentError, match="set_skill_weights"):
        small_runner(tmp_path, 1).run()


def test_features_are_hidden_in_the_losses_but_not_in_the_rewards(tmp_path: Path) -> None:
    runner = small_runner(tmp_path, 1)
    agent, rollout = runner.agent, runner._collect()
    first, second = agent.rewards(rollout), agent.rewards(rollout)
    assert torch.equal(first["style"], second["style"])
    assert isinstance(agent, CASE)
    x = torch.ones(5, 12)
    agent.discriminator.train()
    assert not torch.equal(agent.discriminator.features(x), agent.discriminator.features(x))
    rollout["advantage"] = torch.zeros(rollout.shape)
    rollout["return"] = torch.zeros(rollout.shape)
    agent.update(rollout)
    assert not agent.discriminator.training


def test_labels_lie_on_the_sphere_and_the_policys_losses_move_them(tmp_path: Path) -> None:
    runner = small_runner(tmp_path, 1)
    assert isinstance(runner.agent, CASE)
    label: LabelEmbedding = runner.agent.label
    before = label(torch.arange(SKILLS)).detach()
    runner.run()
    torch.testing.assert_close(before.norm(dim=1), torch.ones(SKILLS))
    assert not torch.equal(before, label(torch.arange(SKILLS)))


def test_an_environment_without_labels_is_refused(generator: torch.Generator) -> None:
    env = PointMass(2)
    space = env.single_observation_space
    assert isinstance(space, spaces.Dict)
    env.single_observation_space = spaces.Dict({**space.spaces, "skill": spaces.Box(0, 1)})
    with pytest.raises(AgentError, match=r"'skill'"):
        make_case(env, generator)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"focal": "hard"}, r"agent\.focal=hard is not one of paper, normalised, code, none"),
        ({"focal_floor": 0.0}, r"agent\.focal_floor=0\.0: needs a share above 0"),
        ({"focal_rate": 1.5}, r"agent\.focal_rate=1\.5"),
    ],
)
def test_impossible_settings_are_refused_in_one_line(changes: dict, message: str) -> None:
    with pytest.raises(AgentError, match=message):
        small_case(**changes)


def test_a_checkpoint_of_fewer_labels_is_refused(generator: torch.Generator) -> None:
    state = make_case(PointMass(3, skills=2), generator).state_dict()
    with pytest.raises(AgentError, match="label embedding differs"):
        make_case(PointMass(3, skills=3), generator).load_state_dict(state)


def test_a_warm_start_hears_the_labels(generator: torch.Generator) -> None:
    """The same states have other actions under another label, and one label is ten times as frequent as the other."""
    env = PointMass(4, skills=2)
    agent = make_case(env, generator)

    actions = torch.tensor([[0.6, -0.4], [-0.5, 0.7]])

    def pairs(n: int, generator: torch.Generator) -> dict[str, Tensor]:
        skill = (torch.arange(n) % 11 == 0).long()
        return {"state": torch.randn(n, 4, generator=generator), "skill": skill, "action": actions[skill]}

    config = WarmStartConfig(steps=200, pairs=2000, minibatch=64, learning_rate=1e-2)
    curve = warm_start(agent.model, pairs, config, generator, agent.draw_condition)
    assert max(curve[-10:]) < 0.01  # deaf to the labels it could not get below a tenth
    label = torch.arange(40) % 2
    done, _ = agent.model.act(torch.randn(40, 4, generator=generator), agent.draw_condition(label))
    torch.testing.assert_close(done, actions[label], atol=0.2, rtol=0)
