"""Forces from outside that fade while few fall."""

from pathlib import Path
from typing import Any

import pytest
import torch

from murmillo.agents.case.agent import CASE
from murmillo.agents.common.assistance import Assistance, AssistanceConfig
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.exploration import ActionNoise
from murmillo.agents.common.ppo import ActorCritic, PPOConfig
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.runner import Runner, RunnerConfig
from tests.agents.toy import PointMass, make_case


class Helped(PointMass):
    """The second number of an action is a force from outside."""

    residual_dim = 1


def make(generator: torch.Generator, **changes: Any) -> tuple[ActorCritic, Assistance]:
    model = ActorCritic(4, 2, 0, PPOConfig(hidden=(8,), style_hidden=()), generator)
    config = AssistanceConfig(**{"fade": 0.5, "falls": 0.1, "from_iteration": 0, **changes})
    return model, Assistance(model, Helped(4), config)


def rollout(fallen: int, tracking: float = 0.0) -> Rollout:
    """40 steps, of which so many end in a fall; all earn the same for following."""
    batch = Rollout(10, 4)
    batch["tracking"] = torch.full((10, 4), tracking)
    batch["terminated"] = (torch.arange(40) < fallen).view(10, 4)
    return batch


def test_what_is_left_of_the_forces_scales_the_mean_alone(generator: torch.Generator) -> None:
    model, assistance = make(generator)
    state = torch.randn(5, 4, generator=generator)
    before, _ = model.act(state)
    sampled = model.act(state, None, ActionNoise(torch.Generator().manual_seed(3)))[0] - before
    assert assistance.update(rollout(0), 0) == {"share": 0.5, "falls": 0.0}
    after, _ = model.act(state)
    torch.testing.assert_close(after, before * torch.tensor([1.0, 0.5]))
    noise = model.act(state, None, ActionNoise(torch.Generator().manual_seed(3)))[0] - after
    torch.testing.assert_close(noise, sampled)


def test_nothing_goes_while_many_fall_or_too_early(generator: torch.Generator) -> None:
    _, assistance = make(generator, from_iteration=2)
    assert [assistance.update(rollout(0), i)["share"] for i in range(4)] == [1.0, 1.0, 0.5, 0.25]
    _, assistance = make(generator)
    assert assistance.update(rollout(8), 0) == {"share": 1.0, "falls": pytest.approx(0.2)}
    shares = [assistance.update(rollout(0), i)["share"] for i in range(1, 9)]
    assert shares[:6] == [1.0] * 6  # it remembers: 0.2 * 0.9^6 is still above
    assert shares[6:] == [0.5, 0.25]


def test_nothing_goes_while_the_clips_are_not_followed(generator: torch.Generator) -> None:
    _, assistance = make(generator, tracking=0.5)
    assert assistance.update(rollout(0, 0.4), 0)["share"] == 1.0
    shares = [assistance.update(rollout(0, 0.6), i)["share"] for i in range(1, 9)]
    assert shares[:6] == [1.0] * 6  # 0.6 - 0.2 * 0.9^6 is still below
    assert shares[6:] == [0.5, 0.25]


def test_where_nothing_is_followed_nothing_can_be_asked_of_it(generator: torch.Generator) -> None:
    _, assistance = make(generator, tracking=0.5)
    batch = Rollout(10, 4)
    batch["terminated"] = torch.zeros(10, 4, dtype=torch.bool)
    with pytest.raises(AgentError, match=r"agent.assistance.tracking=0.5: nobody follows a clip; set env.tracking"):
        assistance.update(batch, 0)


def test_the_last_hundredth_goes_at_once(generator: torch.Generator) -> None:
    model, assistance = make(generator)
    shares = [assistance.update(rollout(0), i)["share"] for i in range(9)]
    assert shares[5:] == [0.5**6, 0.0, 0.0, 0.0]
    assert (model.act(torch.randn(3, 4, generator=generator))[0][:, 1] == 0.0).all()


def test_what_is_to_stay_stays(generator: torch.Generator) -> None:
    _, assistance = make(generator, least=0.2)
    shares = [assistance.update(rollout(0), i)["share"] for i in range(4)]
    assert shares == pytest.approx([0.5, 0.25, 0.2, 0.2])


def test_it_is_a_part_of_the_run(tmp_path: Path) -> None:
    def helped() -> tuple[CASE, Runner]:
        generator = torch.Generator().manual_seed(0)
        env = Helped(32, skills=2)
        agent = make_case(env, generator, assistance=AssistanceConfig(fade=0.1, falls=1.0, from_iteration=1))
        return agent, Runner(env, agent, RunnerConfig(samples=32 * 8 * 4, horizon=8), generator, tmp_path)

    (agent, runner), (again, _) = helped(), helped()
    runner.run()
    reach = agent.model.policy.reach
    torch.testing.assert_close(reach, torch.tensor([1.0, 0.9**3]))  # of four iterations the first takes nothing
    again.load_state_dict(agent.state_dict())
    assert torch.equal(again.model.policy.reach, reach)
    assert again.assistance.state_dict() == agent.assistance.state_dict()
    again.assistance.update(rollout(0), 100)
    assert again.model.policy.reach[1] == pytest.approx(0.9**4)


def test_without_such_forces_nothing_can_fade(generator: torch.Generator) -> None:
    with pytest.raises(AgentError, match=r"agent.assistance.fade=0.01: there are no residual forces; set env.residual"):
        make_case(PointMass(4, skills=2), generator, assistance=AssistanceConfig(fade=0.01))


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"fade": -0.1}, r"agent.assistance.fade=-0.1"),
        ({"fade": 1.0}, r"agent.assistance.fade=1.0: needs a share of less than 1"),
        ({"tracking": -1.0}, r"agent.assistance.tracking=-1.0"),
        ({"least": 1.5}, r"agent.assistance.least=1.5: needs a share, at most 1"),
        ({"falls": 0.0}, r"agent.assistance.falls=0.0"),
        ({"from_iteration": -1}, r"agent.assistance.from_iteration=-1"),
    ],
)
def test_settings_that_cannot_be(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(AgentError, match=said):
        AssistanceConfig(**settings)
