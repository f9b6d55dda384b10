import numpy as np
import torch

from murmillo.agents.common.normalizer import RunningNormalizer


def test_statistics_are_numpys_of_all_batches_at_once(generator: torch.Generator) -> None:
    normalizer = RunningNormalizer((3,))
    batches = [100 + 5 * torch.randn(4, n, 3, generator=generator) for n in (1, 7, 50)]
    for batch in batches:
        normalizer.update(batch)
    rows = torch.cat([batch.reshape(-1, 3) for batch in batches]).double().numpy()
    np.testing.assert_allclose(normalizer.mean, rows.mean(0), rtol=1e-12)
    np.testing.assert_allclose(normalizer.var, rows.var(0), rtol=1e-10)
    assert normalizer.count == len(rows)
    expected = np.clip((rows - rows.mean(0)) / np.sqrt(rows.var(0) + 1e-5), -5, 5)
    np.testing.assert_allclose(normalizer(torch.from_numpy(rows)), expected, rtol=1e-9)


def test_before_the_first_batch_it_only_clips() -> None:
    x = torch.tensor([-9.0, 0.5, 7.0])
    torch.testing.assert_close(RunningNormalizer()(x), torch.tensor([-5.0, 0.5, 5.0]), atol=1e-5, rtol=1e-5)


def test_what_is_normalised_stays_as_it_is_and_has_a_gradient() -> None:
    normalizer = RunningNormalizer()
    normalizer.update(torch.tensor([1.0, 5.0]))  # mean 3, standard deviation 2
    x = torch.tensor([4.0, 90.0], requires_grad=True)
    y = normalizer(x)
    y.sum().backward()
    assert x.tolist() == [4.0, 90.0]
    assert x.grad is not None
    torch.testing.assert_close(x.grad, torch.tensor([0.5, 0.0]), atol=1e-5, rtol=0)  # none beyond the clip


def test_inverse_and_float32(generator: torch.Generator) -> None:
    normalizer = RunningNormalizer()
    x = 3 + 2 * torch.randn(100, generator=generator)
    normalizer.update(x)
    assert normalizer(x).dtype == torch.float32
    torch.testing.assert_close(normalizer.inverse(normalizer(x)), x)


def test_a_frozen_one_stays_frozen_through_its_state() -> None:
    normalizer = RunningNormalizer()
    normalizer.update(torch.tensor([1.0, 3.0]))
    normalizer.freeze()
    restored = RunningNormalizer()
    restored.load_state_dict(normalizer.state_dict())
    for one in (normalizer, restored):
        one.update(torch.tensor([100.0]))
        assert (one.mean.item(), one.var.item(), one.count.item()) == (2.0, 1.0, 2.0)


def test_a_constant_feature_becomes_zero() -> None:
    normalizer = RunningNormalizer((1,))
    normalizer.update(torch.full((10, 1), 0.3))
    assert normalizer(torch.full((2, 1), 0.3)).abs().max() < 1e-4
