"""A head start in the simulation: the policy learns what leads along the clips in the states that it comes into."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor

from murmillo.agents.common.exploration import ActionNoise
from murmillo.agents.common.networks import Told
from murmillo.agents.common.numbers import check_at_least
from murmillo.agents.common.ppo import ActorCritic
from murmillo.agents.common.rollout import taken, tensors
from murmillo.agents.common.training import adam
from murmillo.agents.common.warm_start import regress

_NOISE, _CORRELATION = 0.02, 0.9
"""Standard deviation of what is added to all actions, and how long it lasts."""
_OWN = 0.7
"""Share of the worlds in which the policy acts, from the second round on."""


@dataclass
class GuidedStartConfig:
    """
    Attributes:
        rounds: of acting and learning; 0 for no guided start.
        steps: control steps of every world in a round.
        updates: gradient steps a round, on the states of all rounds so far.
        minibatch: states a gradient step.
        learning_rate: Adam's step.
    """

    rounds: int = 0
    steps: int = 60
    updates: int = 800
    minibatch: int = 1024
    learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        check_at_least(0, self, "guided_start", "rounds", "learning_rate")
        check_at_least(1, self, "guided_start", "steps", "updates", "minibatch")


class Guided(Protocol):
    """A vector environment that knows what leads along the clips."""

    num_envs: int

    def reset(self, *, seed: int | None = None) -> tuple[Any, Any]: ...

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, Any]: ...

    def guide(self) -> Any:
        """Actions `[N, A]`, whatever the states."""


@dataclass(frozen=True)
class Round:
    """
    Attributes:
        loss: mean squared error of the action over the round's last updates.
        length: mean length of an episode where the policy acted [steps], or the guide in the first round; infinite
            where none has ended.
    """

    loss: float
    length: float


def guided_start(
    model: ActorCritic,
    env: Guided,
    config: GuidedStartConfig,
    generator: torch.Generator,
    condition: Callable[[Tensor], Told] = lambda skill: None,
) -> Iterator[Round]:
    """Dataset aggregation (DAgger, Ross et al. 2011) with the clips' own targets as the expert.

    States of clips say nothing of those beside them, into which every policy comes after some steps. So the worlds are
    stepped, at first by the guide, then in most of them by the policy, always with noise, and the policy is regressed
    on what would lead along the clip in all states that were seen. A guide without residual forces keeps no
    balance; it says where to go.

    Args:
        model: whose policy is fitted; its normaliser learns too, its critic does not.
        env: its observations have "state" `[N, S]` and "skill" `[N]`, and its `guide()` gives actions `[N, A]`.
        config: how long and how fast.
        generator: draws noise, minibatches and the environment's seed.
        condition: draws what the policy is told of states with these labels `[n]`.

    Yields:
        what came of each round.
    """
    policy, normalise = model.policy, model.state_normalizer
    optimizer = adam((policy.parameters(), config.learning_rate))
    noise = ActionNoise(generator, _CORRELATION)
    obs = tensors(env.reset(seed=int(torch.randint(2**31, (), generator=generator)))[0])
    states, skills, guides = [], [], []
    for number in range(config.rounds):
        own = torch.rand(env.num_envs, generator=generator) < (_OWN if number else 0.0)
        judged, ends = own if number else ~own, 0
        for _ in range(config.steps):
            guide = torch.as_tensor(env.guide())
            for kept, seen in ((states, obs["state"]), (skills, obs["skill"]), (guides, guide)):
                kept.append(seen.clone())
            with torch.no_grad():
                mean = policy.mode(policy(normalise(obs["state"]), condition(obs["skill"])))
            action = torch.where(own.unsqueeze(-1), mean, guide) + _NOISE * noise.step(*guide.shape)
            next_obs, _, terminated, *_ = env.step(taken(env, action))
            ends += int((torch.as_tensor(terminated) & judged).sum())
            obs = tensors(next_obs)
        normalise.update(torch.stack(states[-config.steps :]))
        losses = _learn(model, optimizer, config, generator, condition, *map(torch.cat, (states, skills, guides)))
        tail = losses[-50:]
        length = int(judged.sum()) * config.steps / ends if ends else math.inf
        yield Round(sum(tail) / len(tail), length)


def _learn(
    model: ActorCritic,
    optimizer: torch.optim.Optimizer,
    config: GuidedStartConfig,
    generator: torch.Generator,
    condition: Callable[[Tensor], Told],
    state: Tensor,
    skill: Tensor,
    guide: Tensor,
) -> list[float]:
    """Regress the policy on guide [M, A] in state [M, S]; the losses."""
    losses = []
    for _ in range(config.updates):
        rows = torch.randint(len(state), (config.minibatch,), generator=generator)
        seen, told = model.state_normalizer(state[rows]), condition(skill[rows])
        losses.append(regress(model, optimizer, seen, told, guide[rows]))
    return losses
