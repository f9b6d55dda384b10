"""Fisher concentration: by hand, and at both ends of its range."""

import pytest
import torch

from murmillo.envs.metrics.latents import fisher_concentration


def test_by_hand() -> None:
    latent = torch.tensor([[0.0], [2.0], [10.0], [10.0]])
    clip = torch.tensor([3, 3, 7, 7])
    first = ((0 + 2 + 2 + 0) / 4) / ((0 + 2 + 10 + 10 + 2 + 0 + 8 + 8) / 8)
    assert fisher_concentration(latent, clip) == pytest.approx((first + 0.0) / 2)


def test_clips_of_one_point_have_none_and_random_encodings_about_one() -> None:
    generator = torch.Generator().manual_seed(0)
    clip = torch.arange(400) % 8
    points = torch.randn(8, 16, generator=generator)
    assert fisher_concentration(points[clip], clip) == pytest.approx(0.0, abs=1e-3)
    assert fisher_concentration(torch.randn(400, 16, generator=generator), clip) == pytest.approx(1.0, abs=0.05)


def test_a_clip_of_one_window_does_not_count() -> None:
    latent = torch.tensor([[0.0], [2.0], [50.0]])
    alone = fisher_concentration(latent, torch.tensor([0, 0, 1]))
    assert alone == pytest.approx(((0 + 2 + 2 + 0) / 4) / ((0 + 2 + 50 + 2 + 0 + 48) / 6))
