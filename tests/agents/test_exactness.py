"""How exact products of matrices are while a run learns, and who rounds."""

import pytest
import torch

from murmillo.agents.common.discriminator import Discriminator, DiscriminatorConfig
from murmillo.agents.common.exactness import choose, exactness

CPU = torch.device("cpu")


def make_discriminator() -> Discriminator:
    config = DiscriminatorConfig(hidden=(64, 64), dropout=0.0)
    return Discriminator(3, 40, config, torch.Generator().manual_seed(0))


def test_torch_is_as_exact_as_before_once_a_run_has_learned():
    before = torch.get_float32_matmul_precision()
    for how, meant in (("tf32", "high"), ("bf16", "medium"), ("highest", "highest")):
        with exactness(how):
            assert torch.get_float32_matmul_precision() == meant
        with pytest.raises(ZeroDivisionError), exactness(how):
            raise ZeroDivisionError
        assert torch.get_float32_matmul_precision() == before


def test_a_discriminator_rounds_its_trunk_where_it_may_and_nowhere_else():
    discriminator, windows = make_discriminator(), torch.randn(32, 3, 40, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        exact = discriminator.features(discriminator.prepare(windows))
        for how, rounds in (("highest", False), ("tf32", False), ("bf16", True)):
            with exactness(how):
                features = discriminator.features(discriminator.prepare(windows))
            assert features.dtype == torch.float32
            assert torch.equal(features, exact) is not rounds, how
            torch.testing.assert_close(features, exact, atol=0.02, rtol=0.02)


def test_gradients_of_a_gradient_penalty_are_near_the_exact_ones():
    """Of its norm at least: the signs of a rectifier flip where it is almost zero."""
    windows = torch.randn(256, 3, 40, generator=torch.Generator().manual_seed(1))

    def slopes(how: str) -> torch.Tensor:
        discriminator = make_discriminator()
        with exactness(how):
            x = discriminator.prepare(windows).requires_grad_()
            (slope,) = torch.autograd.grad(discriminator.judge(discriminator.features(x)).sum(), x, create_graph=True)
            slope.square().sum(-1).mean().backward()
        gradients = [p.grad.flatten() for p in discriminator.trunk.parameters() if p.grad is not None]
        assert len(gradients) >= 2
        return torch.cat(gradients)

    exact, rounded = slopes("highest"), slopes("bf16")
    assert not torch.equal(exact, rounded)
    assert (exact - rounded).norm() < 0.05 * exact.norm()


def test_auto_rounds_on_a_processor_with_units_for_it_alone(monkeypatch):
    for units, expected in (({}, "highest"), ({"avx512_bf16": True}, "bf16"), ({"amx_bf16": True}, "bf16")):
        monkeypatch.setattr(torch.cpu, "get_capabilities", lambda units=units: units, raising=False)
        assert choose("auto", CPU) == expected
        assert choose("auto", torch.device("cuda")) == "highest"
        assert choose("tf32", CPU) == "tf32"
