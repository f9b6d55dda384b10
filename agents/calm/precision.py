"""Precision training's reward for the style (CALM, section 6.1): latents near the encodings of a commanded motion."""

from dataclasses import dataclass
from typing import Literal, get_args

import torch
from torch import Tensor

from murmillo.agents.calm.agent import CALM
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Demonstrations, Obs

Form = Literal["distance", "cosine"]
"""Of `style_similarity`."""
FORMS: tuple[str, ...] = get_args(Form)


@dataclass
class PrecisionConfig:
    """Which styles are commanded, and what a latent near one is worth.

    Attributes:
        samples: M, encodings of each style, the nearest of which counts; the paper has 1, the released code 32.
        form: "distance" is the paper's, "cosine" the released code's; see `style_similarity`.
        skills: names of the styles; the paper has running, walking and walking crouched. None named leaves the choice
            to who makes the environment.
    """

    samples: int = 1
    form: Form = "distance"
    skills: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.samples < 1:
            raise AgentError(f"precision.samples={self.samples}: needs at least 1; the paper has 1")


def style_similarity(latent: Tensor, reference: Tensor, form: str) -> Tensor:
    """How near latents `[N, Z]` are to the nearest of their references `[N, M, Z]`: `[N]`, at most 1.

    Args:
        latent: of unit length.
        reference: encodings of the commanded motion, of unit length.
        form: "distance", exp(-4 ||z - z'||^2) (eq. 8's second term), or "cosine", (z . z' + 1) / 2 (released code).
    """
    cosine = (reference @ latent[..., None]).squeeze(-1).amax(-1)
    # on the unit sphere ||z - z'||^2 = 2 - 2 z . z'
    return torch.exp(-8 * (1 - cosine)) if form == "distance" else (cosine + 1) / 2


class StyleReward:
    """The term "similarity" of a decision, for a `LatentEnv`; the discrete observation "skill" commands the style.

    The paper's reward is this term plus that of the heading task, which is the environment's.
    """

    def __init__(self, reference: Tensor, form: str = "distance") -> None:
        """
        Args:
            reference: encodings `[K, M, Z]` of each style; the paper has one of each, the released code 32.
            form: of `style_similarity`.
        """
        if form not in FORMS:
            raise AgentError(f"precision.form={form} is not one of {', '.join(FORMS)}")
        self.reference = reference
        self.form = form

    def __call__(self, latent: Tensor, obs: Obs) -> dict[str, Tensor]:
        return {"similarity": style_similarity(latent, self.reference[obs["skill"]], self.form)}


def encode_styles(
    agent: CALM, demonstrations: Demonstrations, skills: int, samples: int, generator: torch.Generator
) -> Tensor:
    """Encodings `[K, M, Z]` of M motions of each of K skills."""
    skill = torch.arange(skills).repeat_interleave(samples)
    drawn = demonstrations(len(skill), generator, skill, agent.config.encoder.frames)
    return agent.encode(drawn["window"], drawn.get("mask")).unflatten(0, (-1, samples))
