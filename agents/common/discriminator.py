"""Tells windows of the agent's motion from windows of the demonstrations (ASE, sections 5.1 and 6.3).

What makes the methods differ is only the `Condition`: nothing (ASE), a latent beside the window (CALM), one output a
skill (C·ASE). The losses (`discriminator_loss.py`) and the reward are the same for all of them.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.exactness import rounded
from murmillo.agents.common.networks import Dropout, Rectifier, linear, mlp
from murmillo.agents.common.normalizer import RunningNormalizer
from murmillo.agents.common.numbers import check_above_zero, check_at_least
from murmillo.agents.common.ranks import ALONE, Part, Ranks

LOSSES = ("logistic", "hinge")


@dataclass
class DiscriminatorConfig:
    """Structure and training of a discriminator (and of an encoder on its trunk).

    Attributes:
        hidden: sizes of the trunk's layers.
        learning_rate: Adam's step.
        minibatch: K, windows a step from the rollout, from the replay and from the demonstrations each.
        updates: steps an iteration; the released code takes one with every policy minibatch, 8 x 6 = 48.
        loss: "logistic", as ASE, CALM and C·ASE were published, or the "hinge" of AdaptNet (its eq. 10).
        gradient_penalty: w_gp of eq. 14, on the logit's gradient at the normalised demonstrations; of a hinge lambda.
        penalty_every: the gradient penalty is a part of every so-manieth update's loss, with so many times its weight
            ("lazy regularisation", Karras et al. 2020, section 4.1, StyleGAN2); it must divide `updates`. 1 is as
            published.
        slope: norm of the gradient that a hinge's penalty leads to; AdaptNet's ensemble leads its sum to 1, each of
            16 discriminators to a sixteenth.
        logit_decay: on the squared weights of the last layer (released code).
        weight_decay: on the squared weights of trunk and last layer (released code).
        replay_size: windows kept from earlier iterations (released code).
        replay_keep: probability that a window enters the full replay (released code).
        dropout: probability that an element is hidden before each layer, the input's included, while the discriminator
            is trained (C·ASE's element-wise feature masking); when it gives rewards it sees everything.
    """

    hidden: tuple[int, ...] = (1024, 1024, 512)
    learning_rate: float = 2e-5
    minibatch: int = 4096
    updates: int = 48
    loss: str = "logistic"
    gradient_penalty: float = 5.0
    penalty_every: int = 1
    slope: float = 0.0625
    logit_decay: float = 0.01
    weight_decay: float = 1e-4
    replay_size: int = 200_000
    replay_keep: float = 0.01
    dropout: float = 0.0

    def __post_init__(self) -> None:
        check_at_least(1, self, "agent.discriminator", "minibatch", "updates", "penalty_every")
        check_at_least(
            0, self, "agent.discriminator", "learning_rate", "gradient_penalty", "logit_decay", "weight_decay"
        )
        check_above_zero(self, "agent.discriminator", "slope")
        if self.updates % self.penalty_every:
            raise AgentError(
                f"agent.discriminator.penalty_every={self.penalty_every}: needs a divisor of updates={self.updates}"
            )
        if self.loss not in LOSSES:
            raise AgentError(f"agent.discriminator.loss={self.loss} is not one of {', '.join(LOSSES)}")


class Windows(NamedTuple):
    """Windows `[B, W, D]`, oldest frame first.

    Attributes:
        condition: what the discriminator is told about each, `[B, ...]` or nothing.
        mask: bool `[B, D]`, true where a feature is left out of all frames of a window; None leaves nothing out.
        part: which of a batch of all ranks they are; None is all of it.
    """

    window: Tensor
    condition: Tensor | None = None
    mask: Tensor | None = None
    part: Part | None = None

    @property
    def total(self) -> int:
        """Windows of all ranks."""
        return len(self.window) if self.part is None else self.part.total

    @property
    def weight(self) -> float:
        """Of means over these windows, beside those of other ranks."""
        return 1.0 if self.part is None else self.part.weight


class Condition(nn.Module):
    """How the discriminator learns what it is to judge by. This one is told nothing (ASE)."""

    inputs = 0
    """Columns that `join` adds."""
    outputs = 1
    """Logits of the last layer, from which `pick` chooses."""

    def join(self, x: Tensor, condition: Tensor | None) -> Tensor:
        """The trunk's input `[B, W D + inputs]` from normalised flat windows `[B, W D]`."""
        return x

    def pick(self, logits: Tensor, condition: Tensor | None) -> Tensor:
        """One logit a window, `[B]` from `[B, outputs]`."""
        return logits[:, 0]


class Discriminator(nn.Module):
    """A logit for every window: positive for a demonstration, negative for the agent."""

    def __init__(
        self,
        frames: int,
        state_dim: int,
        config: DiscriminatorConfig,
        generator: torch.Generator,
        condition: Condition | None = None,
        trunk: nn.Sequential | None = None,
        ranks: Ranks = ALONE,
    ) -> None:
        """
        Args:
            frames: W, frames a window.
            state_dim: D, features a frame.
            config: sizes and weights.
            generator: draws the initial weights.
            condition: what it is told beside the window.
            trunk: from its inputs `[B, W D + ...]` to features `[B, H]`; fully connected layers unless given.
            ranks: who train it.
        """
        super().__init__()
        self.config = config
        self.condition = condition or Condition()
        # one normaliser for all frames: a feature has the same scale wherever it stands in the window, and a stationary
        # feature cannot be told from its place in it
        self.normalizer = RunningNormalizer((state_dim,))
        sizes = [frames * state_dim + self.condition.inputs, *config.hidden]
        self.trunk = trunk or mlp(sizes, generator, config.dropout, Rectifier, ranks)
        self.dropout = Dropout(config.dropout, generator, ranks)
        # a hinge begins about as steep as its penalty wants it, which else takes a million samples to get it there
        bound = config.slope if config.loss == "hinge" else 1.0
        self.head = linear(config.hidden[-1], self.condition.outputs, generator, bound=bound)
        self.eval()

    def observe(self, window: Tensor, mask: Tensor | None = None) -> None:
        """Let the normaliser learn from raw windows `[B, W, D]`, but for what their mask `[B, D]` leaves out."""
        self.normalizer.update(window, None if mask is None else mask[:, None])

    def prepare(self, window: Tensor, mask: Tensor | None = None) -> Tensor:
        """Normalised flat windows `[B, W D]` from raw ones `[B, W, D]`, zero where the mask `[B, D]` leaves out."""
        return leave_out(self.normalizer(window), mask).flatten(1)

    def features(self, x: Tensor, condition: Tensor | None = None) -> Tensor:
        """The trunk's last layer `[B, H]` on prepared windows `[B, W D]`; an encoder may sit on it."""
        with rounded(x.device):
            return self.trunk(self.condition.join(x, condition)).float()

    def judge(self, features: Tensor, condition: Tensor | None = None) -> Tensor:
        """Logits `[B]` from features `[B, H]`."""
        return self.condition.pick(self.head(self.dropout(features)), condition)

    def logits(self, window: Tensor, condition: Tensor | None = None, mask: Tensor | None = None) -> Tensor:
        """Logits `[B]` of raw windows `[B, W, D]`; the arguments are the first of `Windows`."""
        return self.judge(self.features(self.prepare(window, mask), condition), condition)

    def score(self, logits: Tensor) -> Tensor:
        """How much like a demonstration, 0 to 1, any shape: the probability D, or of a hinge where in [-1, 1] it is."""
        return 0.5 * (1 + logits.clamp(-1, 1)) if self.config.loss == "hinge" else logits.sigmoid()

    def reward(self, logits: Tensor) -> Tensor:
        """What the policy gets, never negative, any shape: -log(1 - D), or of a hinge the score.

        The score is AdaptNet's eq. 11, moved from [-1, 1] to [0, 1] lest falling early pays.
        """
        return self.score(logits) if self.config.loss == "hinge" else style_reward(logits)

    def score_of(self, reward: Tensor) -> Tensor:
        """The score that a reward was given for, any shape."""
        return reward if self.config.loss == "hinge" else 1.0 - torch.exp(-reward)


def leave_out(frames: Tensor, mask: Tensor | None) -> Tensor:
    """Normalised frames `[B, W, D]` with zeros, the mean, where the mask `[B, D]` is true."""
    return frames if mask is None else frames.masked_fill(mask[:, None], 0.0)


def style_reward(logits: Tensor, scale: float = 1.0) -> Tensor:
    """-scale log max(1 - D, 1e-4) with D = sigmoid(logit), any shape: 0 to 9.2 at scale 1 (the released code has 2)."""
    return -scale * torch.sigmoid(-logits).clamp(min=1e-4).log()
