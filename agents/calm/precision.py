"""Precision training's reward for the style (CALM, section 6.1): latents near the encodings of a commanded motion."""

import torch
from torch import Tensor

from murmillo.agents.calm.agent import CALM
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Demonstrations, Obs

FORMS = ("distance", "cosine")


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
