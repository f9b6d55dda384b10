"""Fisher concentration and class distances: by hand, and at both ends of their range."""

import pytest
import torch

from murmillo.envs.metrics.latents import class_distances, fisher_concentration


def test_by_hand() -> None:
    latent = torch.tensor([[0.0], [2.0], [10.0], [10.0]])
    clip = torch.tensor([3, 3, 7, 7])
    first = ((0 + 2 + 2 + 0) / 4) / ((0 + 2 + 10 + 10 + 2 + 0 + 8 + 8) / 8)
    assert fisher_concentration(latent, clip) == pytest.approx((first + 0.0) / 2)


def test_clips_of_one_point_have_none_and_random_encodings_about_one() -> None:
    generator = torch.Generator().manual_seed(0)
    clip = torch.arange(400) % 8
    points = torch.randn(8, 16, generator=generator)
    assert fisher_concentration(points[clip], clip) == pytest.approx(0.0, abs=1e-6)
    assert fisher_concentration(torch.randn(400, 16, generator=generator), clip) == pytest.approx(1.0, abs=0.05)


def test_a_clip_of_one_window_does_not_count() -> None:
    latent = torch.tensor([[0.0], [2.0], [50.0]])
    alone = fisher_concentration(latent, torch.tensor([0, 0, 1]))
    assert alone == pytest.approx(((0 + 2 + 2 + 0) / 4) / ((0 + 2 + 50 + 2 + 0 + 48) / 6))


def test_blocks_and_order_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    generator = torch.Generator().manual_seed(0)
    latent, clip = torch.randn(50, 8, generator=generator), torch.arange(50) % 7
    whole, order = fisher_concentration(latent, clip), torch.randperm(50, generator=generator)
    distance = torch.cdist(latent.double(), latent.double())
    assert whole == pytest.approx(
        sum((distance[clip == m][:, clip == m].mean() / distance[clip == m].mean()).item() for m in range(7)) / 7
    )
    monkeypatch.setattr("murmillo.envs.metrics.latents._CELLS", 150)  # three rows at a time
    assert fisher_concentration(latent[order], clip[order]) == pytest.approx(whole, rel=1e-9)


def test_class_distances_by_hand() -> None:
    latent = torch.tensor([[0.0, 0.0], [3.0, 4.0], [0.0, 2.0], [6.0, 8.0]])
    distance = class_distances(latent, torch.tensor([9, 4, 9, 4]))
    across = (5 + 10 + 13**0.5 + 72**0.5) / 4  # from (0, 0) and (0, 2) to (3, 4) and (6, 8)
    torch.testing.assert_close(distance, torch.tensor([[2.5, across], [across, 1.0]]).double(), atol=1e-6, rtol=0.0)


def test_classes_of_one_point_lie_as_far_apart_as_these_points() -> None:
    points, kind = torch.tensor([[0.0, 0.0], [3.0, 4.0]]), torch.tensor([0, 1, 1, 0, 1])
    expected = torch.tensor([[0.0, 5.0], [5.0, 0.0]]).double()
    torch.testing.assert_close(class_distances(points[kind], kind), expected, atol=1e-6, rtol=0.0)
