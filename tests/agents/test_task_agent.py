"""The task agent by itself; `test_contract` asks of it what it asks of every agent."""

from pathlib import Path

import numpy as np
import pytest
import torch
from gymnasium import spaces

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.ppo import PPOConfig
from murmillo.agents.common.rollout import tensors
from murmillo.agents.common.runner import Runner, RunnerConfig
from murmillo.agents.common.task_agent import TaskAgent, TaskAgentConfig
from tests.agents.toy import PointMass
from tests.agents.toy_tasks import Heading, make_commanded, make_task


class Commanded(PointMass):
    """Reward: the velocity along +x under skill 0, against it under skill 1."""

    def step(self, actions: np.ndarray) -> tuple:
        sign = 1 - 2 * self.skill
        obs, _, terminated, truncated, infos = super().step(actions)
        return obs, sign * infos["final_obs"]["state"][:, 2], terminated, truncated, infos


def learnt(env: PointMass, make: object, folder: Path, iterations: int = 20) -> float:
    """Mean task reward of the last iterations."""
    generator, history = torch.Generator().manual_seed(0), []
    weights = {"task": 1.0, "speed": 0.0}
    config = RunnerConfig(samples=iterations * 64 * 8, horizon=8, gamma=0.9, lam=0.9, reward_weights=weights)
    Runner(env, make(env, generator), config, generator, folder, on_iteration=[history.append]).run()  # type: ignore[operator]
    return sum(stats["reward/task"] for stats in history[-5:]) / 5


def test_scratch_learns_a_task_on_the_characters_own_action(tmp_path: Path) -> None:
    """The goal is new in every episode: who does not see it gains nothing on average."""
    assert learnt(Heading(64, bound=9.0), make_task, tmp_path) > 0.3


def test_the_commanded_skill_is_seen_where_it_is_asked_for(tmp_path: Path) -> None:
    assert abs(learnt(Commanded(64, bound=9.0, skills=2), make_task, tmp_path / "blind")) < 0.15
    assert learnt(Commanded(64, bound=9.0, skills=2), make_commanded, tmp_path / "told") > 0.3


def test_it_keeps_what_it_sees_and_no_more(generator: torch.Generator) -> None:
    assert make_task(PointMass(2), generator).needs == {"state", "next_state"}
    assert make_task(Heading(2), generator).needs == {"state", "next_state", "goal", "next_goal"}
    assert make_commanded(PointMass(2), generator).needs == {"state", "next_state", "skill", "next_skill"}


def test_the_papers_policy_begins_at_the_origin(generator: torch.Generator) -> None:
    env = Heading(500)
    agent = TaskAgent(env, TaskAgentConfig(), generator)
    obs = tensors(env.reset(seed=0)[0])
    assert not agent.act(obs, deterministic=True).action.any()
    assert agent.act(obs).action.std().item() == pytest.approx(0.1, rel=0.1)
    assert TaskAgentConfig().ppo == PPOConfig(hidden=(1024, 512), style_hidden=(), std=0.1, mean_init_scale=0.0)


@pytest.mark.parametrize(
    ("name", "space", "message"),
    [
        ("single_observation_space", spaces.Dict({"skill": spaces.Discrete(2)}), "'state'"),
        ("single_observation_space", spaces.Box(-1, 1, (3,)), "'state'"),
        ("single_observation_space", spaces.Dict({"state": spaces.Box(-1, 1, (3,))}), "'skill'"),
        ("single_action_space", spaces.Discrete(3), r"Box action space \[A\]"),
    ],
)
def test_other_spaces_are_refused(name: str, space: spaces.Space, message: str, generator: torch.Generator) -> None:
    env = PointMass(2)
    setattr(env, name, space)
    with pytest.raises(AgentError, match=message) as error:
        make_commanded(env, generator)
    assert "\n" not in str(error.value)
