"""C·ASE's high-level policies (Dou et al. 2023, appendix A.3): a label and a latent are chosen together.

Where a user gives the label (section 3.2), the environment's "skill" reaches the low-level policy by itself, and a
`TaskAgent` that sees it learns the latent alone.
"""

from dataclasses import dataclass

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from torch import Tensor
from torch.distributions import Categorical
from torch.distributions.relaxed_categorical import ExpRelaxedCategorical
from torch.nn import functional as F

from murmillo.agents.common.decoder import Command, to_sphere
from murmillo.agents.common.dimensions import skill_count
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.exploration import ActionNoise
from murmillo.agents.common.networks import GaussianPolicy, linear
from murmillo.agents.common.ppo import PPOConfig, gaussian_settings
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.agents.common.task_agent import TaskAgent, TaskAgentConfig


@dataclass
class HybridConfig(TaskAgentConfig):
    """
    Attributes:
        gumbel: temperature of a straight-through Gumbel-softmax (the paper names no temperature); None draws the label
            from a categorical distribution.
    """

    gumbel: float | None = None

    def __post_init__(self) -> None:
        if self.gumbel is not None and self.gumbel <= 0:
            raise AgentError(f"agent.gumbel={self.gumbel} is no temperature; 1.0 is usual, null draws a categorical")


class HybridDecoder:
    """An action scores every label, of which the highest is meant, and has a latent before its projection."""

    def __init__(self, labels: int, latent_dim: int) -> None:
        self.labels = labels
        self.space = spaces.Box(-np.inf, np.inf, (labels + latent_dim,), np.float32)

    def __call__(self, action: Tensor) -> Command:
        """Commands of actions `[N, K + Z]`; the label takes the place of the environment's "skill"."""
        scores, latent = action.tensor_split([self.labels], -1)
        return Command(to_sphere(latent), {"skill": scores.argmax(-1)})


class HybridPolicy(GaussianPolicy):
    """pi(c, z | s) = Cat(c; logits(s)) N(z; mu(s), diag std^2), on actions as `HybridDecoder` reads them.

    A categorical action scores its label 1 and the others 0. With `gumbel` the scores are drawn from the Concrete
    distribution, in log space (Maddison et al. 2017): PPO learns by the density of these soft scores, while the
    low-level policy is told the hard label. The labels come out as often as from the categorical, but the ratios are
    noisier, since the density also weighs what no label depends on.

    The released code draws its Gumbel noise outside of the probability that PPO knows, and from logits in [-1, 1]: of
    87 labels none could be likelier than 8 %.
    """

    def __init__(
        self,
        state_dim: int,
        labels: int,
        latent_dim: int,
        config: PPOConfig,
        generator: torch.Generator,
        *,
        condition_dim: int = 0,
        gumbel: float | None = None,
    ) -> None:
        """
        Args:
            state_dim: D.
            labels: K.
            latent_dim: Z.
            config: structure; `mean_init_scale` is also that of the logits.
            generator: draws the initial weights.
            condition_dim: C, beside the state.
            gumbel: temperature; None for a categorical.
        """
        super().__init__(state_dim, latent_dim, generator=generator, **gaussian_settings(condition_dim, config))
        self.labels = labels
        self.gumbel = gumbel
        self.label_head = linear(config.hidden[-1], labels, generator)
        with torch.no_grad():
            self.label_head.weight *= config.mean_init_scale

    def read(self, features: Tensor) -> Tensor:
        """Logits of the labels and the latent's mean `[..., K + Z]`."""
        return torch.cat([self.label_head(features), self.head(features)], -1)

    def sample(self, parameters: Tensor, noise: ActionNoise) -> Tensor:
        logits, mean = self._split(parameters)
        latent, worlds = super().sample(mean, noise), noise.worlds(len(logits))
        exponential = torch.empty(worlds.total, self.labels).exponential_(generator=noise.generator)
        gumbel = -worlds.of(exponential).log()
        if noise.quiet is not None:
            gumbel = gumbel.masked_fill(noise.quiet.unsqueeze(-1), 0.0)
        return torch.cat([self._scores(logits + gumbel), latent], -1)

    def mode(self, parameters: Tensor) -> Tensor:
        logits, mean = self._split(parameters)
        return torch.cat([self._scores(logits), mean], -1)

    def log_prob(self, action: Tensor, parameters: Tensor) -> Tensor:
        (scores, latent), (logits, mean) = self._split(action), self._split(parameters)
        if self.gumbel is None:
            label = Categorical(logits=logits).log_prob(scores.argmax(-1))
        else:
            label = ExpRelaxedCategorical(torch.tensor(self.gumbel), logits=logits).log_prob(scores)
        return label + super().log_prob(latent, mean)

    def entropy(self, parameters: Tensor) -> Tensor:
        """Of the label and the latent [nat] `[...]`."""
        logits, mean = self._split(parameters)
        return Categorical(logits=logits).entropy() + super().entropy(mean)

    def bound_loss(self, parameters: Tensor) -> Tensor:
        """Of the latent's mean only: a label may become certain."""
        return super().bound_loss(self._split(parameters)[1])

    def _split(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Of the labels `[..., K]`, of the latent `[..., Z]`."""
        label, latent = x.tensor_split([self.labels], -1)
        return label, latent

    def _scores(self, perturbed: Tensor) -> Tensor:
        """An action's scores from logits `[..., K]` with Gumbel noise, whose argmax is a categorical's sample."""
        if self.gumbel is None:
            return F.one_hot(perturbed.argmax(-1), self.labels).to(perturbed.dtype)
        return F.log_softmax(perturbed / self.gumbel, -1)


def hybrid_agent(
    env: VectorEnv, config: HybridConfig, generator: torch.Generator, *, ranks: Ranks = ALONE
) -> TaskAgent:
    """A `TaskAgent` that chooses labels and latents, in a `LatentEnv` with a `HybridDecoder`.

    Raises:
        AgentError: the environment commands no labels.
    """
    labels = skill_count(env)

    def make_policy(width: int, action_dim: int, condition_dim: int) -> HybridPolicy:
        latent_dim = action_dim - labels
        return HybridPolicy(
            width, labels, latent_dim, config.ppo, generator, condition_dim=condition_dim, gumbel=config.gumbel
        )

    return TaskAgent(env, config, generator, make_policy, ranks=ranks)
