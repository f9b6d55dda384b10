"""Fréchet distance: its closed form for known Gaussians, and its limits."""

import pytest
import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError
from murmillo.envs.metrics.frechet import frechet_distance
from murmillo.envs.metrics.windows import windows


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def whitened(n: int, size: int, seed: int) -> Tensor:
    """Samples [n, size] whose mean is 0 and whose covariance is the identity, up to rounding."""
    samples = normal(n, size, seed=seed)
    samples = samples - samples.mean(0)
    factor = torch.linalg.cholesky(samples.T @ samples / (n - 1))
    return torch.linalg.solve_triangular(factor, samples.T, upper=False).T


def test_by_hand_in_one_dimension() -> None:
    a, b = torch.tensor([[-1.0], [1.0]]), torch.tensor([[1.0], [9.0]])
    assert frechet_distance(a, b) == pytest.approx(5.0**2 + (2.0**0.5 - 32.0**0.5) ** 2)


def test_the_closed_form_of_gaussians_whose_covariances_do_not_commute() -> None:
    """In two dimensions tr((A B)^(1/2)) = sqrt(tr(A B) + 2 sqrt(det(A B)))."""
    first, second = torch.tensor([[2.0, 0.5], [0.0, 1.0]]).double(), torch.tensor([[1.0, 0.0], [-3.0, 0.7]]).double()
    a = whitened(50, 2, seed=1) @ first + torch.tensor([3.0, 4.0])
    b = whitened(70, 2, seed=2) @ second
    product = (first.T @ first) @ (second.T @ second)
    root = (product.trace() + 2 * product.det().sqrt()).sqrt()
    expected = 25.0 + first.square().sum() + second.square().sum() - 2 * root
    assert frechet_distance(a, b) == pytest.approx(expected.item(), rel=1e-9)


@pytest.mark.parametrize(("n", "size"), [(400, 6), (5, 40)], ids=["regular", "singular: fewer samples than features"])
def test_identical_sets_have_none(n: int, size: int) -> None:
    samples = 1.0 + 10.0 * normal(n, size)
    assert frechet_distance(samples, samples.flip(0)) == pytest.approx(0.0, abs=1e-10 * samples.square().sum().item())


def test_a_shifted_set_is_as_far_as_its_shift_though_singular() -> None:
    samples = normal(5, 40)
    assert frechet_distance(samples, samples + 0.5) == pytest.approx(40 * 0.25, rel=1e-9)


def test_it_is_symmetric_and_knows_no_order() -> None:
    a, b = normal(30, 4), 2.0 * normal(20, 4, seed=1)
    distance = frechet_distance(a, b)
    assert frechet_distance(b, a) == pytest.approx(distance, rel=1e-9)
    assert frechet_distance(a[torch.randperm(30, generator=torch.Generator().manual_seed(2))], b) == pytest.approx(
        distance, rel=1e-9
    )


def test_blocks_and_threads_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = normal(30, 4), 2.0 * normal(20, 4, seed=1)
    whole, threads = frechet_distance(a, b), torch.get_num_threads()
    monkeypatch.setattr("murmillo.envs.metrics.frechet._ROWS", 3)
    torch.set_num_threads(2)
    try:
        assert frechet_distance(a, b) == pytest.approx(whole, rel=1e-9)
    finally:
        torch.set_num_threads(threads)


def test_more_frames_see_what_single_ones_cannot() -> None:
    """A motion and the same backwards have the same states, but other transitions."""
    motion = torch.linspace(0.0, 1.0, 50)[:, None].expand(50, 2) * torch.tensor([1.0, -2.0])
    single = [windows([one], 1) for one in (motion, motion.flip(0))]
    double = [windows([one], 2) for one in (motion, motion.flip(0))]
    assert frechet_distance(*single) == pytest.approx(0.0, abs=1e-9)
    assert frechet_distance(*double) > 1e-4


def test_one_sample_is_refused() -> None:
    with pytest.raises(SuiteError, match=r"of 1 sample.*record more"):
        frechet_distance(torch.zeros(1, 3), torch.zeros(5, 3))


def test_windows_do_not_reach_from_one_motion_into_the_next() -> None:
    found = windows([torch.arange(4.0)[:, None], torch.arange(10.0, 12.0)[:, None], torch.full((1, 1), 99.0)], 2)
    assert found.squeeze(-1).tolist() == [[0, 1], [1, 2], [2, 3], [10, 11]]
    states = torch.arange(14.0).view(7, 2)
    torch.testing.assert_close(windows([states], 2, hop=3), torch.stack((states[0:2], states[3:5])))
    with pytest.raises(SuiteError, match="longest motion has 4; ask for shorter"):
        windows([torch.zeros(4, 1)], 5)
