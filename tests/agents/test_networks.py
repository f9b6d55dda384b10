import pytest
import torch
from torch import nn

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.networks import Dropout, GaussianPolicy, Rectifier, linear, mlp


def policy(seed: int = 0, **changes: object) -> GaussianPolicy:
    return GaussianPolicy(5, 3, (16, 8), 0.05, torch.Generator().manual_seed(seed), condition_dim=4, **changes)  # type: ignore


def test_weights_come_from_the_generator_alone() -> None:
    torch.manual_seed(1)
    first = policy().state_dict()
    torch.manual_seed(2)
    second = policy().state_dict()
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert not torch.equal(first["head.weight"], policy(seed=1).state_dict()["head.weight"])


def test_initial_weights_and_biases(generator: torch.Generator) -> None:
    layer = linear(100, 200, generator)
    assert 0.099 < layer.weight.abs().max() <= 0.1  # 1 / sqrt(100)
    assert layer.bias.abs().max() == 0
    assert 0.99 < linear(100, 200, generator, bound=1.0).weight.abs().max() <= 1


def test_layers_end_in_a_rectifier(generator: torch.Generator) -> None:
    assert mlp([3, 7, 6], generator)(torch.randn(50, 3)).min() == 0


def test_the_rectifier_is_pytorchs_but_its_slope_is_a_constant(generator: torch.Generator) -> None:
    first, last = linear(4, 6, generator), linear(6, 1, generator)
    points = torch.randn(20, 4, generator=generator)
    found = []
    for activation in (nn.ReLU(), Rectifier()):
        x = points.clone().requires_grad_()
        hidden = activation(first(x))
        (slope,) = torch.autograd.grad(last(hidden).sum(), x, create_graph=True)
        penalty = slope.square().sum()
        learned = torch.autograd.grad(penalty, [first.weight, last.weight], retain_graph=True)
        assert min(gradient.abs().max().item() for gradient in learned) > 0
        found.append([hidden, slope, *learned])
    assert all(torch.equal(a, b) for a, b in zip(*found, strict=True))
    # no way back from the penalty through the layer's values, which would cost as much as the gradient itself
    assert torch.autograd.grad(penalty, x, allow_unused=True) == (None,)
    edge = torch.tensor([-1.0, 0.0, float("nan")])
    assert torch.equal(Rectifier()(edge)[:2], edge.new_zeros(2))
    assert Rectifier()(edge)[2].isnan()


def test_dropout_hides_a_share_and_keeps_the_mean_while_training_only(generator: torch.Generator) -> None:
    dropout, x = Dropout(0.2, generator), torch.ones(40_000)
    state = torch.get_rng_state()
    y = dropout(x)
    assert set(y.unique().tolist()) == {0.0, 1.25}
    assert (y == 0).float().mean().item() == pytest.approx(0.2, abs=0.01)
    assert torch.equal(dropout.eval()(x), x)
    assert torch.equal(state, torch.get_rng_state())  # a checkpoint does not keep torch's own


def test_dropout_stands_before_every_layer(generator: torch.Generator) -> None:
    names = [type(layer).__name__ for layer in mlp([3, 7, 6], generator, dropout=0.1)]
    assert names == ["Dropout", "Linear", "ReLU"] * 2
    with pytest.raises(AgentError, match=r"dropout=1\.0"):
        mlp([3, 7], generator, dropout=1.0)


def test_shapes_std_and_scale(generator: torch.Generator) -> None:
    state, latent = torch.randn(6, 7, 5, generator=generator), torch.randn(6, 7, 4, generator=generator)
    mean = policy()(state, latent)
    assert mean.shape == (6, 7, 3)
    torch.testing.assert_close(policy().log_std.exp(), torch.full((3,), 0.05))
    torch.testing.assert_close(policy(mean_init_scale=0.01)(state, latent), 0.01 * mean)


def test_the_style_network_answers_within_its_tanh(generator: torch.Generator) -> None:
    style = policy(style_hidden=(8,)).style(100 * torch.randn(20, 4, generator=generator))
    assert style.shape == (20, 4)
    assert style.abs().max() <= 1


def test_a_learned_std_begins_at_the_given_one_and_has_a_gradient(generator: torch.Generator) -> None:
    state, latent = torch.randn(9, 5, generator=generator), torch.randn(9, 4, generator=generator)
    fixed, learned = policy(), policy(learn_std=True)
    assert torch.equal(fixed.log_std, learned.log_std)
    assert fixed.state_dict().keys() == learned.state_dict().keys()
    assert dict(learned.named_parameters()).keys() - dict(fixed.named_parameters()).keys() == {"log_std"}
    mean = learned(state, latent)
    learned.log_prob(mean.detach() + 1.0, mean).sum().backward()
    assert learned.log_std.grad is not None
    assert learned.log_std.grad.min() > 0  # what happened was farther off than a standard deviation
