"""Focal skill sampling: what is hard to imitate is practised more (C·ASE, section 3.1, eq. 4)."""

from typing import Any

import torch
from torch import Tensor

from murmillo.agents.case.config import CASEConfig
from murmillo.agents.common.ranks import ALONE, Ranks

_PACE, _REACH = 0.02, 20.0
"""Exponent of a correction of `FocalSampling.commanded` in an iteration, and its bound either way."""
_TINY = 1e-6
"""Keeps a score that rounds to 0 or 1 inside, and the weight of an only skill, which fades by eq. 4, above 0."""


def hardness(score: Tensor, form: str) -> Tensor:
    """What the weights of the skills `[K]` move towards, from the discriminator's mean score of each `[K]` in (0, 1).

    Args:
        score: b_c, the probability that the agent's motions under skill c are clips of it: low where it is hard.
        form: "paper" has sigma(b_c) = 1 - b_c / sum b of eq. 4, which sums to K - 1: no skill comes to get more than
            K / (K - 1) of its even share, 1.2 % more with 87 skills. "normalised" is in proportion to 1 - b_c, whatever
            K is. "code" is eq. 4 of 1 - b_c, which turns the rule round: hard skills get less.
    """
    if form == "normalised":
        return (1 - score) / (1 - score).sum()
    share = 1 - score if form == "code" else score
    return 1 - share / share.sum()


class FocalSampling:
    """How often each skill is practised.

    Attributes:
        score: b_c `[K]`, the last known mean score of each skill.
        weight: w_c `[K]`, not normalised.
        probability: of drawing each skill `[K]`.
    """

    CODE_RATE = 0.1
    """The released code averages twice: over time at this rate, then its result into the sampling at `focal_rate`."""

    def __init__(self, skills: int, config: CASEConfig) -> None:
        self.config = config
        self.score = torch.full((skills,), 0.5)
        self.weight = torch.full((skills,), 1 / skills)
        self.probability = self.weight.clone()
        self._correction = torch.ones(skills)

    @property
    def commanded(self) -> Tensor:
        """Weights `[K]` to command new episodes with; where shares are of steps, short ones are begun more often."""
        weight = self.probability * self._correction
        return weight / weight.sum()

    def draw(self, n: int, generator: torch.Generator) -> Tensor:
        """Labels `[n]` int64."""
        return torch.multinomial(self.probability, n, replacement=True, generator=generator)

    def update(self, scores: Tensor, labels: Tensor, active: bool = True, *, ranks: Ranks = ALONE) -> None:
        """Eq. 4 once.

        Args:
            scores: D `[n]` of the agent's motions, in [0, 1]; a skill that has none keeps its last mean.
            labels: under which they were made `[n]`.
            active: whether the sampling follows the scores already.
            ranks: who have motions each; all then come to the same weights.
        """
        config, skills = self.config, len(self.score)
        count = ranks.sum(torch.bincount(labels, minlength=skills))
        mean = ranks.sum(torch.zeros(skills).index_add(0, labels, scores)) / count
        self.score = torch.where(count > 0, mean, self.score).clamp(_TINY, 1 - _TINY)
        if config.focal_steps:
            missing = self.probability / (count / count.sum()).clamp(min=_TINY)
            self._correction = (self._correction * missing.clamp(0.5, 2.0) ** _PACE).clamp(1 / _REACH, _REACH)
        if config.focal == "none" or not active:
            return
        rate = self.CODE_RATE if config.focal == "code" else config.focal_rate
        self.weight = (1 - rate) * self.weight + rate * hardness(self.score, config.focal)
        weight = self.weight
        if config.focal == "code":
            weight = (1 - config.focal_rate) * self.probability + config.focal_rate * weight
        floored = (weight / weight.sum().clamp(min=_TINY)).clamp(min=config.focal_floor / skills)
        self.probability = floored / floored.sum()

    def scalars(self) -> dict[str, float]:
        """How far from uniform: least and greatest share relative to the uniform's, and entropy [nat]."""
        relative = self.probability * len(self.probability)
        entropy = -(self.probability * self.probability.log()).sum()
        return {"least": relative.min().item(), "greatest": relative.max().item(), "entropy": entropy.item()}

    def state_dict(self) -> dict[str, Any]:
        return {
            "score": self.score,
            "weight": self.weight,
            "probability": self.probability,
            "correction": self._correction,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self.score, self.weight, self.probability = state["score"], state["weight"], state["probability"]
        self._correction = state["correction"]
