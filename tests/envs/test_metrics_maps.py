"""Maps: what has a plane is given back, and neighbours stay neighbours."""

import builtins
from typing import Any

import pytest
import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError
from murmillo.envs.metrics.maps import classical_mds, tsne


def plane(n: int, dims: int) -> Tensor:
    """Points [n, dims] float64 that lie in a tilted plane."""
    generator = torch.Generator().manual_seed(0)
    axes = torch.linalg.qr(torch.randn(dims, 2, generator=generator).double()).Q
    return (torch.randn(n, 2, generator=generator).double() * torch.tensor([3.0, 1.0])) @ axes.T + 5.0


def test_mds_keeps_the_distances_of_points_in_a_plane() -> None:
    points = plane(30, 7)
    distance = torch.cdist(points, points)
    found = classical_mds(distance)
    torch.testing.assert_close(torch.cdist(found, found), distance, atol=1e-6, rtol=0.0)
    assert found.mean(0).abs().max() < 1e-9
    assert found[:, 0].std() > found[:, 1].std()


def test_mds_of_a_line_by_hand() -> None:
    found = classical_mds(torch.tensor([[0.0, 1.0, 4.0], [1.0, 0.0, 3.0], [4.0, 3.0, 0.0]]))
    expected = torch.tensor([[-5.0, 0.0], [-2.0, 0.0], [7.0, 0.0]]).double() / 3
    torch.testing.assert_close(found, expected, atol=1e-6, rtol=0.0)


def test_mds_moves_with_the_order_of_points() -> None:
    points = plane(30, 7)
    order = torch.randperm(30, generator=torch.Generator().manual_seed(1))
    found, again = (classical_mds(torch.cdist(some, some)) for some in (points, points[order]))
    torch.testing.assert_close(again, found[order], atol=1e-6, rtol=0.0)


def test_tsne_keeps_clusters_and_its_seed() -> None:
    pytest.importorskip("sklearn", reason="needs scikit-learn, the extra `metrics`")
    generator = torch.Generator().manual_seed(0)
    cluster = torch.arange(60) % 3
    points = 20.0 * torch.randn(3, 16, generator=generator)[cluster] + torch.randn(60, 16, generator=generator)
    found = tsne(points, seed=0)
    assert found.shape == (60, 2)
    nearest = torch.cdist(found, found).fill_diagonal_(float("inf")).argmin(1)
    assert (cluster[nearest] == cluster).all()
    assert torch.equal(found, tsne(points, seed=0))


def test_tsne_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def absent(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.startswith("sklearn"):
            raise ModuleNotFoundError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", absent)
    with pytest.raises(
        SuiteError, match=r"^t-SNE needs scikit-learn; install it with: pip install murmillo\[metrics\]$"
    ):
        tsne(torch.zeros(10, 3), seed=0)
