"""Forces from outside that fade while few fall."""

from pathlib import Path
from typing import Any

import pytest
import torch

from murmillo.agents.case.agent import CASE
from murmillo.agents.common.assistance import Assistance, AssistanceConfig
from murmillo.agents.common.base import Base
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.ppo import Minibatch
from murmillo.agents.common.ranks import ALONE, Part
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.runner import Runner, RunnerConfig
from tests.agents.toy import PointMass, make_case, small_case


class Helped(PointMass):
    """The second number of an action is a force from outside."""

    residual_dim = 1


def make(skills: int = 2, **changes: Any) -> Assistance:
    config = AssistanceConfig(**{"fade": 0.5, "falls": 0.1, "from_iteration": 0, **changes})
    return Assistance(skills, Helped(4, skills=skills), config)


def rollout(fallen: tuple[int, int] = (0, 0), follows: tuple[float, float] = (0.0, 0.0)) -> Rollout:
    """20 steps of each of two skills, of which so many end in a fall and earn so much for following."""
    batch = Rollout(10, 4)
    batch["label"] = torch.tensor([[0, 1, 0, 1]]).repeat(10, 1)
    batch["tracking"] = torch.tensor(follows)[batch["label"]]
    number = torch.arange(40).view(10, 4) // 2  # of the step among those of its skill
    batch["terminated"] = number < torch.tensor(fallen)[batch["label"]]
    return batch


def shares(assistance: Assistance, times: int, *args: Any) -> list[list[float]]:
    """What each skill has left after each update."""
    left = []
    for iteration in range(times):
        assistance.update(rollout(*args), iteration)
        left.append(assistance.share.tolist())
    return left


def test_what_is_left_of_a_skills_forces_scales_their_mean_alone(generator: torch.Generator) -> None:
    agent = make_case(Helped(4, skills=2), generator)
    obs = {"state": torch.randn(4, 4, generator=generator), "skill": torch.tensor([0, 1, 0, 1])}
    agent.latents.hold(agent.draw_latents(1)[0])
    before = agent.act(obs, deterministic=True).action
    noise = agent.act(obs).action - before
    state = agent.noise.generator.get_state()
    agent.assistance.share[1] = 0.25
    after = agent.act(obs, deterministic=True).action
    torch.testing.assert_close(after, before * torch.tensor([[1.0, 1.0], [1.0, 0.25]] * 2))
    assert noise.abs().min() > 0
    assert torch.equal(agent.noise.generator.get_state(), state)


def test_what_acted_is_what_learns(generator: torch.Generator) -> None:
    """Probabilities in PPO's loss are those of the policy that acted, with what its forces had left."""
    agent = make_case(Helped(4, skills=2), generator)
    agent.assistance.share[:] = torch.tensor([0.5, 0.25])
    obs = {"state": torch.randn(4, 4, generator=generator), "skill": torch.tensor([0, 1, 0, 1])}
    step = agent.act(obs)
    state = agent.model.state_normalizer(obs["state"])
    told = agent._tell(Minibatch({"state": state, **step.extras}, Part(ALONE, 4)))
    log_prob = agent.model.policy.log_prob(step.action, agent.model.policy(state, told))
    torch.testing.assert_close(log_prob, step.log_prob)


def test_forces_that_are_gone_are_no_diversity(generator: torch.Generator) -> None:
    agent = make_case(Helped(4, skills=2), generator, diversity="action")
    agent.assistance.share[:] = 0.0
    obs = {"state": torch.randn(4, 4, generator=generator), "skill": torch.tensor([0, 1, 0, 1])}
    batch = Minibatch({"state": obs["state"], **agent.act(obs).extras}, Part(ALONE, 4))
    losses = []
    for factor in (1.0, 9.0):
        with torch.no_grad():
            agent.model.policy.head.weight[1] *= factor
        agent.generator.manual_seed(1)
        mean = agent.model.policy(batch["state"], agent._tell(batch))
        losses.append(agent._diversity(batch, mean)["diversity"].item())
    assert losses[0] == losses[1] > 0.0


def test_nothing_goes_while_many_fall_or_too_early() -> None:
    assert shares(make(from_iteration=2), 4) == [[1.0, 1.0], [1.0, 1.0], [0.5, 0.5], [0.25, 0.25]]
    left = shares(make(), 3, (0, 3))  # 0.15 of the second skill's steps: too many, and not twice as many
    assert left == [[0.5, 1.0], [0.25, 1.0], [0.125, 1.0]]


def test_nothing_goes_of_a_skill_that_is_followed_less_than_it_was() -> None:
    assistance = make(follows=0.8, fade=0.1, from_iteration=99)
    assert shares(assistance, 100, (0, 0), (0.5, 0.5))[-1] == [pytest.approx(0.9)] * 2
    known = []
    for iteration in range(100, 140):
        assistance.update(rollout((0, 0), (0.5, 0.3)), iteration)
        known.append((assistance.follows[1].item(), assistance.share[1].item()))
    still = [share for follows, share in known if 0.38 <= follows < 0.399]  # above what it comes back at
    assert len(still) > 1
    assert len(set(still)) == 1
    again = [share for follows, share in known if follows < 0.37]
    assert again == sorted(again)
    assert again[-1] > again[0]
    assert assistance.share[0].item() < 0.02  # the other goes on


def test_what_was_taken_comes_back_where_many_fall() -> None:
    assistance = make(fade=0.1)
    shares(assistance, 30)
    assert 0.0 < assistance.share[1] < 0.05
    for iteration in range(200):
        assistance.update(rollout((0, 8)), iteration)
    assert assistance.share.tolist() == [0.0, 1.0]


def test_the_last_hundredth_goes_at_once_and_can_come_back() -> None:
    assistance = make()
    left = [share[0] for share in shares(assistance, 9)]
    assert left[5:] == [0.5**6, 0.0, 0.0, 0.0]
    for iteration in range(100):
        assistance.update(rollout((20, 20)), iteration)
    assert assistance.share.tolist() == [1.0, 1.0]


def test_a_skill_that_nobody_practised_stays_as_it_is() -> None:
    assistance = make(skills=3)
    shares(assistance, 3)
    assert assistance.share.tolist() == [0.125, 0.125, 1.0]
    assert assistance.updates.tolist() == [3, 3, 0]
    assert assistance.falls.tolist() == [0.0] * 3
    assert assistance.follows.tolist() == [0.0] * 3


def test_what_is_to_stay_stays() -> None:
    assert [share[0] for share in shares(make(least=0.2), 4)] == pytest.approx([0.5, 0.25, 0.2, 0.2])


def test_where_nothing_is_followed_nothing_can_be_asked_of_it() -> None:
    batch = Rollout(10, 4)
    batch["label"] = torch.zeros(10, 4, dtype=torch.int64)
    batch["terminated"] = torch.zeros(10, 4, dtype=torch.bool)
    with pytest.raises(AgentError, match=r"agent.assistance.follows=0.5: nobody follows a clip; set env.tracking"):
        make(follows=0.5).update(batch, 0)


def test_it_is_a_part_of_the_run(tmp_path: Path) -> None:
    def helped() -> tuple[CASE, Runner]:
        generator = torch.Generator().manual_seed(0)
        env = Helped(32, skills=2)
        agent = make_case(env, generator, assistance=AssistanceConfig(fade=0.1, falls=1.0, from_iteration=1))
        return agent, Runner(env, agent, RunnerConfig(samples=32 * 8 * 4, horizon=8), generator, tmp_path)

    (agent, runner), (again, _) = helped(), helped()
    runner.run()
    torch.testing.assert_close(
        agent.assistance.share, torch.full((2,), 0.9**3)
    )  # of four iterations the first takes nothing
    assert agent.skill_tables()["forces"].tolist() == agent.assistance.share.tolist()
    again.load_state_dict(agent.state_dict())
    for name, value in agent.assistance.state_dict().items():
        assert torch.equal(again.assistance.state_dict()[name], value), name
    again.assistance.update(rollout(), 100)
    torch.testing.assert_close(again.assistance.share, torch.full((2,), 0.9**4))


def test_an_adaptation_keeps_what_its_base_has_left(generator: torch.Generator) -> None:
    settings = AssistanceConfig(fade=0.1, falls=1.0, from_iteration=0)
    agent = make_case(Helped(4, skills=2), generator, assistance=settings)
    agent.assistance.share[:] = torch.tensor([0.5, 0.25])
    state = agent.state_dict()
    base = Base.of(state["ppo"]["model"], state)
    env = Helped(4, skills=2)
    adapted = CASE(env, env.demonstrations, small_case(assistance=settings), generator, base)
    assert adapted.assistance.share.tolist() == [0.5, 0.25]
    assert adapted.assistance.update(rollout(), 100) == {}
    assert adapted.assistance.share.tolist() == [0.5, 0.25]


def test_without_such_forces_nothing_can_fade(generator: torch.Generator) -> None:
    with pytest.raises(AgentError, match=r"agent.assistance.fade=0.01: there are no residual forces; set env.residual"):
        make_case(PointMass(4, skills=2), generator, assistance=AssistanceConfig(fade=0.01))
    assert "forces" not in make_case(PointMass(4, skills=2), generator).skill_tables()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"fade": -0.1}, r"agent.assistance.fade=-0.1"),
        ({"fade": 1.0}, r"agent.assistance.fade=1.0: needs a share of less than 1"),
        ({"follows": -1.0}, r"agent.assistance.follows=-1.0"),
        ({"follows": 1.1}, r"agent.assistance.follows=1.1: needs a share, at most 1"),
        ({"least": 1.5}, r"agent.assistance.least=1.5: needs a share, at most 1"),
        ({"falls": 0.0}, r"agent.assistance.falls=0.0"),
        ({"from_iteration": -1}, r"agent.assistance.from_iteration=-1"),
    ],
)
def test_settings_that_cannot_be(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(AgentError, match=said):
        AssistanceConfig(**settings)
