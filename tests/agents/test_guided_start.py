"""A policy that learns from a guide in the states that it comes into."""

import math
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.vector import VectorEnv

from murmillo.agents.common.guided_start import GuidedStartConfig, guided_start
from murmillo.agents.common.ppo import ActorCritic, PPOConfig

GOALS = torch.tensor([[0.6, 0.0], [-0.6, 0.3]])


class Slope(VectorEnv):
    """Points that are led to the goal of their label, and roll away from it."""

    num_envs, tensors = 64, True

    def __init__(self) -> None:
        self.generator = torch.Generator().manual_seed(5)
        self.taken: list[torch.Tensor] = []
        self.left: list[torch.Tensor] = []

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[dict[str, Any], dict[str, Any]]:
        self.place = torch.randn(64, 2, generator=self.generator) * 0.1
        self.skill = torch.arange(64) % 2
        return self._seen(), {}

    def step(self, actions: torch.Tensor) -> tuple[dict[str, Any], Any, Any, Any, dict[str, Any]]:
        self.taken.append(actions - self.guide())
        self.place = self.place * 1.05 + 0.2 * actions
        gone = self.place.norm(dim=-1) > 1.5
        self.place = torch.where(gone[:, None], torch.zeros_like(self.place), self.place)
        self.left.append(gone)
        return self._seen(), np.zeros(64), gone, torch.zeros(64, dtype=torch.bool), {}

    def guide(self) -> torch.Tensor:
        return (GOALS[self.skill] - self.place).clamp(-1.0, 1.0)

    def _seen(self) -> dict[str, torch.Tensor]:
        return {"state": self.place.clone(), "skill": self.skill}


def make(generator: torch.Generator) -> ActorCritic:
    return ActorCritic(2, 2, 2, PPOConfig(hidden=(32,), style_hidden=()), generator)


def told(skill: torch.Tensor) -> torch.Tensor:
    return torch.nn.functional.one_hot(skill, 2).float()


def test_the_policy_comes_to_do_what_its_guide_says_wherever_it_goes(generator: torch.Generator) -> None:
    model, env = make(generator), Slope()
    critic = [p.clone() for p in model.critic.parameters()]
    rounds = list(guided_start(model, env, GuidedStartConfig(4, steps=20, updates=150, minibatch=128), generator, told))
    assert len(rounds) == 4
    assert rounds[-1].loss < 0.01
    assert math.isinf(rounds[0].length)  # nobody has left, the guide acted alone
    assert len(env.taken) == 80
    led = torch.stack(env.taken[:20]).std()
    assert 0.01 < led < 0.03  # noise alone
    assert torch.stack(env.taken[20:40]).std() > 1.2 * led  # the policy acts in most of the worlds
    for skill in range(2):
        place = torch.randn(50, 2, generator=generator) * 0.2
        mean = model.policy.mode(model.policy(model.state_normalizer(place), told(torch.full((50,), skill))))
        torch.testing.assert_close(mean, (GOALS[skill] - place).clamp(-1, 1), atol=0.15, rtol=0)
    assert all(torch.equal(a, b) for a, b in zip(critic, model.critic.parameters(), strict=True))


def test_it_depends_on_the_generator_alone() -> None:
    weights = []
    for _ in range(2):
        generator = torch.Generator().manual_seed(2)
        model = make(generator)
        list(guided_start(model, Slope(), GuidedStartConfig(2, steps=3, updates=5, minibatch=8), generator, told))
        weights.append(model.policy.state_dict())
    assert all(torch.equal(weights[0][name], weights[1][name]) for name in weights[0])


@pytest.mark.parametrize("rounds", [0, 1])
def test_no_rounds_no_step(generator: torch.Generator, rounds: int) -> None:
    env = Slope()
    assert len(list(guided_start(make(generator), env, GuidedStartConfig(rounds, 2, 1, 4), generator, told))) == rounds
    assert len(env.taken) == 2 * rounds
