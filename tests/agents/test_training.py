import torch
from torch import nn

from murmillo.agents.common.training import adam, minimise


def test_a_step_goes_down_the_sum_of_the_losses_and_leaves_no_gradient_elsewhere() -> None:
    learned, frozen = nn.Parameter(torch.ones(2)), nn.Parameter(torch.ones(2), requires_grad=False)
    unused, x = nn.Parameter(torch.ones(1)), torch.ones(2, requires_grad=True)
    optimizer = adam(([learned, frozen, unused], 0.1))
    minimise(optimizer, {"one": (learned * x * frozen).sum(), "two": 2 * learned.sum()})
    assert learned.grad is not None
    assert learned.grad.tolist() == [3.0, 3.0]
    assert torch.allclose(learned, torch.full((2,), 0.9))
    assert frozen.tolist() == [1.0, 1.0]
    assert unused.tolist() == [1.0]
    assert x.grad is None  # an input that a penalty differentiates by is nothing to learn, and costs as much as a layer
