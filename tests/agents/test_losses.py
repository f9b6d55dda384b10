import math

import pytest
import torch
from torch.distributions import Independent, Normal, kl_divergence

from murmillo.agents.common import losses
from murmillo.agents.common.skill_discovery import diversity_loss, encoder_loss, skill_reward

T = torch.tensor


def test_gaussian_quantities_are_those_of_torch(generator: torch.Generator) -> None:
    mean, action = torch.randn(2, 5, 3, generator=generator)
    log_std = T([-1.0, 0.0, 0.5])
    truth = Independent(Normal(mean, log_std.exp()), 1)
    torch.testing.assert_close(losses.gaussian_log_prob(action, mean, log_std), truth.log_prob(action))
    torch.testing.assert_close(losses.gaussian_entropy(log_std), truth.entropy()[0])


@pytest.mark.parametrize(
    ("ratio", "advantage", "loss"),
    [
        (1.1, 2.0, -2.2),  # within the clip
        (1.5, 2.0, -2.4),  # better already: clipped to 1.2
        (0.5, 2.0, -1.0),  # worse: not clipped
        (0.5, -2.0, 1.6),  # better already: clipped to 0.8
        (1.5, -2.0, 3.0),  # worse: not clipped
    ],
)
def test_ppo_policy_loss(ratio: float, advantage: float, loss: float) -> None:
    result = losses.ppo_policy_loss(T([math.log(ratio)]), T([0.0]), T([advantage]), clip=0.2)
    assert result.item() == pytest.approx(loss)


def test_value_and_bound_loss() -> None:
    assert losses.value_loss(T([1.0, 3.0]), T([0.0, 1.0])).item() == 2.5
    # 0.5^2 + 1^2 of the first, nothing of the second
    assert losses.action_bound_loss(T([[1.5, -2.0], [1.0, -0.3]])).item() == 0.625


def test_divergence_and_clipped_share() -> None:
    new, old = T([0.0, math.log(2.0)]), T([0.0, 0.0])
    assert losses.approx_kl(new, old).item() == pytest.approx((1 - math.log(2)) / 2)
    assert losses.clip_fraction(new, old, 0.2).item() == 0.5


def test_encoder_loss_and_skill_reward() -> None:
    mu = T([[1.0, 0.0], [0.0, 1.0]])
    z = T([[0.6, 0.8], [0.6, -0.8]])
    assert encoder_loss(mu, z, kappa=2.0).item() == pytest.approx(0.2)
    torch.testing.assert_close(skill_reward(mu, z, 1.0, "log_q"), T([0.6, -0.8]))
    torch.testing.assert_close(skill_reward(mu, z, 1.0, "clamped"), T([0.6, 0.0]))


def test_diversity_loss_by_hand() -> None:
    mean, other = T([[2.0, 0.0]]), T([[0.0, 0.5]])
    z, opposite = T([[1.0, 0.0]]), T([[-1.0, 0.0]])  # D_z = 1
    std = T([2.0, 0.5])
    action = ((1.0 + 0.25) / 2 - 1) ** 2  # the first mean is clipped to 1
    assert diversity_loss(mean, other, z, opposite, std, "action").item() == pytest.approx(action, abs=1e-4)
    divergence = kl_divergence(Independent(Normal(mean, std), 1), Independent(Normal(other, std), 1)).item()  # 1
    assert divergence == pytest.approx(1.0)
    orthogonal = T([[0.0, 1.0]])  # D_z = 1/2
    assert diversity_loss(mean, other, z, orthogonal, std, "kl").item() == pytest.approx((1 / 0.5 - 1) ** 2, abs=1e-3)
