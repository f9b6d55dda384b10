"""What an agent can do, in episodes: how long it stays up, how often it falls, how much it moves like the clips."""

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from murmillo.agents.common.discriminator import Discriminator
from murmillo.agents.common.interface import Agent, Labelled
from murmillo.agents.common.rollout import Rollout, tensors, true_next_obs
from murmillo.envs import HumanoidVectorEnv

AGES = {"untrained": "before training", "warm_started": "after the warm start", "trained": "after training"}
"""The ages of a policy that are measured, in words."""

_HEAD = "head/"


class Judge(Agent, Protocol):
    """An agent whose reward term "style" its discriminator gives."""

    discriminator: Discriminator


@dataclass(frozen=True)
class Measures:
    """Means over the first episode of each world, started in a clip, with the policy's mean action.

    Attributes:
        episodes: worlds.
        steps: control steps that were measured, of all worlds together.
        length: of an episode [steps]; the clock's end where it never fell.
        fall_rate: share of the episodes that ended by a fall.
        score: how much like a clip the judge finds a motion (`Discriminator.score`), mean over the steps.
        rewards: the judge's reward terms by name, mean over the steps.
        heads: of a judge with labels, what its heads give by name (`Labelled.head_scores`), mean over the steps.
        residual_share: mean L2 norm of the residual forces [N] over that of the joint torques [N m], if there are any.
    """

    episodes: int
    steps: int
    length: float
    fall_rate: float
    score: float
    rewards: dict[str, float]
    heads: dict[str, float] = field(default_factory=dict)
    residual_share: float | None = None

    def as_dict(self) -> dict[str, Any]:
        return dataclasses.asdict(self)


@torch.no_grad()
def measure(env: HumanoidVectorEnv, agent: Agent, judge: Judge, seed: int) -> Measures:
    """Let `agent` play one episode in each world; `judge`, the trained agent, gives the rewards.

    With one judge, policies of different ages can be compared: each one's own discriminator has seen through it.
    """
    obs, _ = env.reset(seed=seed, options={"start": "reference"})
    worlds = env.num_envs
    agent.reset(torch.arange(worlds))
    alive = torch.ones(worlds, dtype=torch.bool)
    length, fell = torch.zeros(worlds), torch.zeros(worlds, dtype=torch.bool)
    totals: dict[str, float] = {}
    row = Rollout(1, worlds)
    while alive.any():
        seen = tensors(obs)
        step = agent.act(seen, deterministic=True)
        obs, _, terminated, truncated, infos = env.step(step.action.numpy())
        successor = {f"next_{name}": value for name, value in true_next_obs(obs, infos).items()}
        row.store(0, {**seen, **step.extras, **successor, "action": step.action})
        for name, value in {**_terms(judge, row), **_efforts(infos)}.items():
            totals[name] = totals.get(name, 0.0) + value[alive].sum().item()
        length += alive
        fell |= alive & torch.as_tensor(terminated)
        done = torch.as_tensor(np.logical_or(terminated, truncated))
        agent.reset(done.nonzero().flatten())
        alive &= ~done
    steps = int(length.sum())
    means = {name: total / steps for name, total in totals.items()}
    score = means.pop("score")
    heads = {name[len(_HEAD) :]: means.pop(name) for name in list(means) if name.startswith(_HEAD)}
    share = means.pop("residual_force") / means.pop("joint_torque") if "residual_force" in means else None
    return Measures(worlds, steps, length.mean().item(), fell.float().mean().item(), score, means, heads, share)


def _terms(judge: Judge, row: Rollout) -> dict[str, Tensor]:
    """[N] the judge's reward terms and the score behind their style; the scores of its heads, if any."""
    terms = {name: value[0] for name, value in judge.rewards(row).items()}
    heads = judge.head_scores(row) if isinstance(judge, Labelled) else {}
    return {
        **terms,
        "score": judge.discriminator.score_of(terms["style"]),
        **{_HEAD + name: value[0] for name, value in heads.items()},
    }


def _efforts(infos: dict[str, Any]) -> dict[str, Tensor]:
    """[N] the norms of residual forces and joint torques, where there are residual forces."""
    return {name: torch.as_tensor(infos[name]) for name in ("residual_force", "joint_torque") if name in infos}
