"""An ensemble of discriminators that judges windows by a hinge (Xu and Karamouzas 2021; AdaptNet, eqs. 10 and 11)."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from murmillo.agents.common.discriminator import (
    Condition,
    Discriminator,
    DiscriminatorConfig,
    Windows,
)
from murmillo.agents.common.discriminator_loss import interpolate, slope_penalty
from murmillo.agents.common.networks import mlp
from murmillo.agents.common.numbers import check_at_least
from murmillo.agents.common.ranks import ALONE, Part
from murmillo.agents.common.recurrent import LastOutput


@dataclass
class EnsembleConfig:
    """Structure and training of the ensemble; the numbers are the released code's.

    Attributes:
        recurrent: units of the GRU that reads a window.
        hidden: sizes of the layers after it.
        heads: discriminators, one an output.
        learning_rate: Adam's step.
        minibatch: windows a step from the rollout, and as many from the demonstrations.
        epochs: passes over the rollout an iteration.
        gradient_penalty: lambda of eq. 10.
    """

    recurrent: int = 256
    hidden: tuple[int, ...] = (256, 128)
    heads: int = 32
    learning_rate: float = 1e-5
    minibatch: int = 256
    epochs: int = 1
    gradient_penalty: float = 10.0

    def __post_init__(self) -> None:
        check_at_least(1, self, "agent.discriminator", "recurrent", "heads", "minibatch", "epochs")
        check_at_least(0, self, "agent.discriminator", "learning_rate", "gradient_penalty")


class AllHeads(Condition):
    """Every output is a discriminator, and all are asked."""

    def __init__(self, heads: int) -> None:
        super().__init__()
        self.outputs = heads

    def pick(self, logits: Tensor, condition: Tensor | None) -> Tensor:
        return logits


class Ensemble(Discriminator):
    """N discriminators on one GRU: `logits` are `[B, N]`, above 0 for a demonstration."""

    def __init__(self, frames: int, frame_dim: int, config: EnsembleConfig, generator: torch.Generator) -> None:
        """
        Args:
            frames: W, frames a window.
            frame_dim: D, features a frame.
            config: sizes.
            generator: draws the initial weights.
        """
        trunk = nn.Sequential(
            nn.Unflatten(1, (frames, frame_dim)),
            LastOutput(frame_dim, config.recurrent, generator),
            *mlp([config.recurrent, *config.hidden], generator),
        )
        sizes = DiscriminatorConfig(hidden=config.hidden)
        super().__init__(frames, frame_dim, sizes, generator, AllHeads(config.heads), trunk)
        # orthogonal heads differ as much as they can while there are no more of them than features
        for layer in trunk:
            if isinstance(layer, nn.Linear):
                nn.init.orthogonal_(layer.weight, gain=2**0.5, generator=generator)
        nn.init.orthogonal_(self.head.weight, generator=generator)


class HingeLoss(NamedTuple):
    """Weighted parts of the loss, whose sum is minimised, and scores to log, by name."""

    parts: dict[str, Tensor]
    scores: dict[str, Tensor]


def hinge_loss(
    ensemble: Ensemble, agent: Windows, demonstration: Windows, penalty: float, generator: torch.Generator
) -> HingeLoss:
    """Eq. 10 as named parts, on equally many windows `[B, W, D]` of the agent and of demonstrations,
    which are the same part of theirs.

        mean max(0, 1 + D_n(agent)) + mean max(0, 1 - D_n(demonstration)) + lambda E (||d sum_n D_n / dx|| - 1)^2

    The penalty is at normalised windows on the lines between the two. The equation has the gradient of each D_n in it;
    the released code, and so its lambda, has that of their sum.
    """
    real = ensemble.prepare(demonstration.window, demonstration.mask)
    fake = ensemble.prepare(agent.window, agent.mask)
    real_logits, fake_logits = (ensemble.judge(ensemble.features(x)) for x in (real, fake))
    part = agent.part or Part(ALONE, len(real))
    between = interpolate(fake, real, part, generator)
    parts = {
        "agent": F.relu(1 + fake_logits).mean(),
        "demonstration": F.relu(1 - real_logits).mean(),
        "gradient_penalty": penalty * slope_penalty(ensemble.judge(ensemble.features(between)), between, 1.0),
    }
    with torch.no_grad():
        scores = {
            "agent_score": fake_logits.mean(),
            "demonstration_score": real_logits.mean(),
            "agent_accuracy": (fake_logits.mean(1) < 0).float().mean(),
            "demonstration_accuracy": (real_logits.mean(1) > 0).float().mean(),
        }
    return HingeLoss(part.weigh(parts), part.weigh(scores))


def imitation_reward(logits: Tensor) -> Tensor:
    """Eq. 11: the mean of all heads `[..., N]`, each clipped to [-1, 1]."""
    return logits.clamp(-1, 1).mean(-1)
