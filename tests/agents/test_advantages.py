import pytest
import torch
from torch import Tensor

from murmillo.agents.common.advantages import gae, normalise_advantage


def estimate(terminated: list[bool], truncated: list[bool]) -> Tensor:
    """One world, three steps, gamma = 0.5, lambda = 0.5."""
    column = lambda values: torch.tensor(values)[:, None]  # noqa: E731
    end, cut = column(terminated), column(truncated)
    return gae(
        reward=column([1.0, 2.0, 3.0]),
        value=column([10.0, 20.0, 30.0]),
        next_value=column([20.0, 30.0, 40.0]),
        terminated=end,
        done=end | cut,
        gamma=0.5,
        lam=0.5,
    )[:, 0]


# deltas without an end: 1 + 10 - 10 = 1, 2 + 15 - 20 = -3, 3 + 20 - 30 = -7
@pytest.mark.parametrize(
    ("terminated", "truncated", "expected"),
    [
        # -7; -3 - 7/4; 1 - 4.75/4
        ([False, False, False], [False, False, False], [-0.1875, -4.75, -7.0]),
        # the second step has no future: 2 - 20, and no trace of the third
        ([False, True, False], [False, False, False], [-3.5, -18.0, -7.0]),
        # a time limit keeps its future, 2 + 15 - 20, but no trace of the third
        ([False, False, False], [False, True, False], [0.25, -3.0, -7.0]),
    ],
)
def test_gae_by_hand(terminated: list[bool], truncated: list[bool], expected: list[float]) -> None:
    assert estimate(terminated, truncated).tolist() == expected


def test_gae_of_one_lambda_is_the_return_minus_the_value(generator: torch.Generator) -> None:
    reward = torch.randn(5, 3, generator=generator)
    value = torch.randn(6, 3, generator=generator)
    never = torch.zeros(5, 3, dtype=torch.bool)
    returned = value[5]
    for t in reversed(range(5)):
        returned = reward[t] + 0.9 * returned
    advantage = gae(reward, value[:5], value[1:], never, never, gamma=0.9, lam=1.0)
    torch.testing.assert_close(advantage[0], returned - value[0])


def test_normalised_advantage() -> None:
    torch.testing.assert_close(
        normalise_advantage(torch.tensor([[1.0, 3.0]])), torch.tensor([[-1.0, 1.0]]), atol=2e-5, rtol=0
    )
    assert normalise_advantage(torch.ones(4)).abs().max() == 0
