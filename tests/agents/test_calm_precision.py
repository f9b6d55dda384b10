"""Precision training's reward by hand, from CALM's own encodings, and as a term of a decision."""

import math
from typing import Any

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from murmillo.agents.calm.precision import PrecisionConfig, StyleReward, encode_styles, style_similarity
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.latent_env import LatentEnv
from tests.agents.toy import MOTION_FRAMES, PointMass, make_calm
from tests.agents.toy_tasks import Compass, Heading


def test_similarity_by_hand() -> None:
    z = torch.tensor([[1.0, 0], [1.0, 0], [1.0, 0], [0.6, 0.8]])
    reference = torch.tensor([[1.0, 0], [0, 1], [-1, 0], [0.8, 0.6]])[:, None]
    squared = (z - reference[:, 0]).square().sum(-1)
    torch.testing.assert_close(style_similarity(z, reference, "distance"), torch.exp(-4 * squared))
    assert style_similarity(z, reference, "distance")[1].item() == pytest.approx(math.exp(-8))
    torch.testing.assert_close(style_similarity(z, reference, "cosine"), torch.tensor([1.0, 0.5, 0.0, 0.98]))


@pytest.mark.parametrize("form", ["distance", "cosine"])
def test_of_several_references_the_nearest_counts(form: str, generator: torch.Generator) -> None:
    z, reference = (
        F.normalize(torch.randn(20, 4, generator=generator), dim=-1),
        torch.randn(20, 7, 4, generator=generator),
    )
    reference = F.normalize(reference, dim=-1)
    each = torch.stack([style_similarity(z, reference[:, [m]], form) for m in range(7)], 1)
    torch.testing.assert_close(style_similarity(z, reference, form), each.amax(1))


def test_references_encode_motions_of_their_style(generator: torch.Generator) -> None:
    env = PointMass(2, skills=3)
    agent = make_calm(env, generator)
    asked = []

    def demonstrations(*args: Any, **kwargs: Any) -> dict[str, torch.Tensor]:
        drawn = env.demonstrations(*args, **kwargs)
        asked.append(drawn["window"].shape)
        return drawn

    reference = encode_styles(agent, demonstrations, 3, 5, torch.Generator().manual_seed(4))
    assert reference.shape == (3, 5, agent.latent_dim)
    assert asked == [(15, MOTION_FRAMES, 4)]
    skill = torch.arange(3).repeat_interleave(5)
    drawn = env.demonstrations(15, torch.Generator().manual_seed(4), skill, MOTION_FRAMES)
    torch.testing.assert_close(reference.flatten(0, 1), agent.encode(drawn["window"]))


def test_references_leave_out_what_their_clips_do_not_show(generator: torch.Generator) -> None:
    """A skill of several clips, each masked or not as it came; what is made up changes nothing."""
    env = PointMass(2, skills=3)
    agent = make_calm(env, generator)

    def demonstrations(made_up: float) -> Any:
        def draw(n: int, generator: torch.Generator, skill: Any = None, frames: Any = None) -> dict:
            drawn = env.demonstrations(n, generator, skill, frames)
            mask = torch.zeros(n, drawn["window"].shape[-1], dtype=torch.bool)
            mask[::2, 1] = True
            return {**drawn, "window": drawn["window"].masked_fill(mask[:, None], made_up), "mask": mask}

        return draw

    found = [
        encode_styles(agent, demonstrations(made_up), 3, 4, torch.Generator().manual_seed(4)) for made_up in (0.3, 90.0)
    ]
    torch.testing.assert_close(*found)
    unmasked = encode_styles(agent, env.demonstrations, 3, 4, torch.Generator().manual_seed(4))
    same = torch.isclose(found[0], unmasked).all(-1)
    assert same[:, 1::2].all()
    assert not same[:, ::2].any()


@pytest.mark.parametrize("form", ["distance", "cosine"])
def test_the_style_that_is_commanded_counts(form: str, generator: torch.Generator) -> None:
    """As a term of a decision, beside the task's reward."""
    env = Heading(50, skills=3, bound=9.0)
    reference = F.normalize(torch.randn(3, 2, 3, generator=generator), dim=-1)
    latent_env = LatentEnv(env, Compass(), latent_terms=StyleReward(reference, form))
    obs, _ = latent_env.reset(seed=0)
    latent = F.normalize(torch.randn(50, 3, generator=generator), dim=-1)
    infos = latent_env.step(latent)[4]
    expected = style_similarity(latent, reference[torch.as_tensor(obs["skill"])], form)
    np.testing.assert_allclose(infos["side_rewards"]["similarity"], expected, rtol=1e-5)
    assert {0, 1, 2} == set(obs["skill"].tolist())


def test_another_form_is_refused() -> None:
    with pytest.raises(AgentError, match=r"precision\.form=squared is not one of distance, cosine"):
        StyleReward(torch.zeros(1, 1, 3), "squared")


def test_a_style_needs_an_encoding() -> None:
    with pytest.raises(AgentError, match=r"precision\.samples=0: needs at least 1"):
        PrecisionConfig(samples=0)
