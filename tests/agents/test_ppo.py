from typing import Any

import pytest
import torch

from murmillo.agents.common.advantages import normalise_advantage
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.exploration import ActionNoise
from murmillo.agents.common.losses import action_bound_loss
from murmillo.agents.common.ppo import PPO, ActorCritic, PPOConfig
from murmillo.agents.common.rollout import Rollout


def make(**changes: Any) -> PPO:
    rates = {"policy_learning_rate": 1e-2, "value_learning_rate": 1e-2}
    config = PPOConfig(**{"hidden": (16,), "std": 0.2, "minibatch": 20, **rates, **changes})
    return PPO(ActorCritic(3, 2, 0, config, torch.Generator().manual_seed(0)), config)


def rollout(ppo: PPO, generator: torch.Generator) -> Rollout:
    """50 samples whose first action should grow."""
    batch = Rollout(5, 10)
    for t in range(5):
        state = 7 + torch.randn(10, 3, generator=generator)
        action, log_prob = ppo.model.act(state, None, ActionNoise(generator))
        batch.store(t, {"state": state, "action": action, "log_prob": log_prob})
    batch["advantage"] = normalise_advantage(batch["action"][..., 0])
    batch["return"] = 100 + 10 * batch["state"][..., 1]
    return batch


def mean_action(ppo: PPO) -> torch.Tensor:
    state = torch.full((1, 3), 7.0)
    return ppo.model.act(state)[0][0]


def test_it_moves_towards_what_was_better_and_learns_the_return(generator: torch.Generator) -> None:
    ppo = make()
    errors = []
    before = mean_action(ppo)
    for _ in range(20):
        batch = rollout(ppo, generator)
        errors.append((ppo.model.value(batch["state"], None) - batch["return"]).square().mean().item())
        ppo.update(batch, generator)
    assert mean_action(ppo)[0] > before[0] + 0.3
    assert errors[-1] < 0.2 * batch["return"].var()


def test_means_beyond_the_bound_come_back(generator: torch.Generator) -> None:
    ppo = make()
    with torch.no_grad():
        ppo.model.policy.head.bias.fill_(2.0)
    for _ in range(10):
        batch = rollout(ppo, generator)
        batch["advantage"] = torch.zeros(5, 10)
        stats = ppo.update(batch, generator)
    assert stats["bound"] < 0.1
    assert action_bound_loss(mean_action(ppo)) < 0.05


def test_normalisers_learn_once_and_only_after_the_update(generator: torch.Generator) -> None:
    ppo = make(epochs=3)
    batch = rollout(ppo, generator)
    stats = ppo.update(batch, generator)
    assert ppo.model.state_normalizer.count == 50
    torch.testing.assert_close(ppo.model.return_normalizer.mean, batch["return"].double().mean())
    # the first pass met the statistics that the actions were drawn with, so that its ratios began at 1
    fresh = make(epochs=1, policy_learning_rate=0.0)
    batch = rollout(fresh, generator)
    assert fresh.update(batch, generator)["kl"] < 1e-6 < stats["kl"]


def test_too_large_a_step_ends_the_passes() -> None:
    taken = {}
    for target_kl in (1e-9, 1e9, None):
        generator = torch.Generator().manual_seed(3)
        ppo = make(epochs=5, target_kl=target_kl)
        ppo.update(rollout(ppo, generator), generator)
        taken[target_kl] = int(ppo.optimizer.state[ppo.model.policy.head.weight]["step"])
    # the first minibatch meets the policy that acted, the second one that has moved
    assert taken == {1e-9: 1, 1e9: 15, None: 15}


def test_a_further_loss_and_a_condition_reach_the_networks(generator: torch.Generator) -> None:
    config = PPOConfig(hidden=(8,), style_hidden=(8,), minibatch=20, epochs=1)
    ppo = PPO(ActorCritic(3, 2, 4, config, generator), config)
    batch = Rollout(5, 10)
    for t in range(5):
        state, label = torch.randn(10, 3, generator=generator), torch.randn(10, 4, generator=generator)
        action, log_prob = ppo.model.act(state, label, ActionNoise(generator))
        batch.store(t, {"state": state, "label": label, "action": action, "log_prob": log_prob})
    batch["advantage"] = batch["return"] = torch.randn(5, 10, generator=generator)
    stats = ppo.update(
        batch,
        generator,
        fields=("label",),
        condition=lambda rows: rows["label"],
        extra_loss=lambda rows, mean: {"pull": (mean - rows["label"][:, :2]).square().mean()},
    )
    assert stats["pull"] > 0
    assert all(parameter.grad is not None for parameter in ppo.model.parameters())


def test_the_rate_is_led_to_the_kl_that_is_asked_for(generator: torch.Generator) -> None:
    rates: dict[float, list[float]] = {}
    for goal in (1e-6, 0.02, 1e6):
        ppo = make(epochs=2, lead_kl=goal)
        stats = [ppo.update(rollout(ppo, generator), generator) for _ in range(40)]
        rates[goal] = [stat["policy_rate"] for stat in stats]
        assert ppo.optimizer.param_groups[0]["lr"] == rates[goal][-1]
        assert ppo.optimizer.param_groups[1]["lr"] == 1e-2  # the critic's is nobody's to lead
        if goal == 0.02:
            assert sum(stat["kl"] for stat in stats[20:]) / 20 == pytest.approx(goal, rel=0.6)
    assert rates[1e-6][:2] == pytest.approx([1e-2 / 1.3, 1e-2 / 1.3**2])
    assert rates[1e6][:2] == pytest.approx([1.3e-2, 1.69e-2])
    assert rates[1e-6][-1] == pytest.approx(1e-4)  # a hundredth of the config's, and no less
    assert rates[1e6][-1] == pytest.approx(1.0)


@pytest.mark.parametrize("rate", [0.0, 1e-2])
def test_the_noise_of_a_policy_that_is_always_right_shrinks_if_it_is_learned(rate: float) -> None:
    """At its own rate: the weights hardly move here."""
    generator, ppo = torch.Generator().manual_seed(1), make(std_learning_rate=rate, policy_learning_rate=1e-9)
    for _ in range(10):
        batch = rollout(ppo, generator)
        mean = ppo.model.policy(ppo.model.state_normalizer(batch["state"]))
        batch["advantage"] = normalise_advantage(-(batch["action"] - mean.detach()).square().sum(-1))
        ppo.update(batch, generator)
    std = ppo.model.policy.log_std.exp()
    assert (std < 0.18).all() if rate else (std == torch.tensor(0.2).log().exp()).all()


def test_the_noise_does_not_shrink_below_its_least() -> None:
    generator, ppo = torch.Generator().manual_seed(1), make(std_learning_rate=0.1, std_least=0.15)
    for _ in range(10):
        batch = rollout(ppo, generator)
        mean = ppo.model.policy(ppo.model.state_normalizer(batch["state"]))
        batch["advantage"] = normalise_advantage(-(batch["action"] - mean.detach()).square().sum(-1))
        ppo.update(batch, generator)
    torch.testing.assert_close(ppo.model.policy.log_std.exp(), torch.full((2,), 0.15))


def test_a_least_noise_above_the_first_is_refused() -> None:
    with pytest.raises(AgentError, match=r"agent\.ppo\.std_least=0\.06: needs at most std, 0\.05"):
        PPOConfig(std_least=0.06)


def test_with_momentum_the_policy_goes_on_where_it_was_going() -> None:
    gone = []
    for momentum in (0.0, 0.99):
        generator, ppo = torch.Generator().manual_seed(1), make(policy_momentum=momentum, epochs=1)
        critic = [p.detach().clone() for p in ppo.model.critic.parameters()]
        for advantage in (1.0, 0.0):  # the second update has nothing to say
            batch = rollout(ppo, generator)
            batch["advantage"] = advantage * batch["action"].sum(-1)
            before = [p.detach().clone() for p in ppo.model.policy.parameters()]
            ppo.update(batch, generator)
        moves = [(p - q).abs().max() for p, q in zip(ppo.model.policy.parameters(), before, strict=True)]
        gone.append(max(moves).item())
        assert any((p != q).any() for p, q in zip(ppo.model.critic.parameters(), critic, strict=True))
        state = ppo.state_dict()
        again = make(policy_momentum=momentum)
        again.load_state_dict(state)
        assert [group["betas"][0] for group in again.optimizer.param_groups] == [momentum, 0.9, 0.9]
    assert gone[0] < 0.3 * gone[1]


def test_a_momentum_that_never_ends_is_refused() -> None:
    with pytest.raises(AgentError, match=r"agent\.ppo\.policy_momentum=1\.0: needs at least 0 and less than 1"):
        PPOConfig(policy_momentum=1.0)


def test_the_kl_that_is_asked_for_shrinks_with_the_iterations(generator: torch.Generator) -> None:
    ppo = make(epochs=2, lead_kl=0.06, kl_halving=20)
    kls = [ppo.update(rollout(ppo, generator), generator)["kl"] for _ in range(160)]
    assert sum(kls[60:80]) / 20 == pytest.approx(0.06 / 4.5, rel=0.6)
    assert sum(kls[120:]) / 40 == pytest.approx(0.06 / 8, rel=0.6)
    again = make(lead_kl=0.06, kl_halving=20)
    again.load_state_dict(ppo.state_dict())
    assert again.state_dict()["iterations"] == 160


def test_the_bound_on_the_kl_shrinks_too() -> None:
    taken = []
    for halving in (0, 1):
        generator = torch.Generator().manual_seed(3)
        ppo = make(epochs=5, target_kl=0.5, kl_halving=halving)
        for _ in range(30):
            before = int(ppo.optimizer.state_dict()["state"].get(0, {"step": 0})["step"])
            ppo.update(rollout(ppo, generator), generator)
        taken.append(int(ppo.optimizer.state_dict()["state"][0]["step"] - before))
    assert taken[1] < taken[0] == 15


def test_a_led_rate_goes_on_where_it_was(generator: torch.Generator) -> None:
    ppo = make(lead_kl=1e-6)
    for _ in range(3):
        ppo.update(rollout(ppo, generator), generator)
    again, kept = make(lead_kl=1e-6), make()
    for other in (again, kept):
        other.load_state_dict(ppo.state_dict())
    assert again.optimizer.param_groups[0]["lr"] == ppo.optimizer.param_groups[0]["lr"] < 1e-2
    assert kept.optimizer.param_groups[0]["lr"] == 1e-2


def test_what_makes_the_condition_waits_for_the_policy(generator: torch.Generator) -> None:
    for alone in (0, 1):
        config = PPOConfig(hidden=(8,), style_hidden=(8,), minibatch=20, epochs=1, critic_first=alone)
        made = torch.nn.Parameter(torch.ones(4))
        ppo = PPO(ActorCritic(3, 2, 4, config, generator), config, [made])
        batch = Rollout(5, 10)
        for t in range(5):
            state = torch.randn(10, 3, generator=generator)
            action, log_prob = ppo.model.act(state, made.expand(10, 4), ActionNoise(generator))
            batch.store(t, {"state": state, "action": action, "log_prob": log_prob})
        batch["advantage"] = batch["return"] = torch.randn(5, 10, generator=generator)
        ppo.update(batch, generator, condition=lambda rows: made.expand(len(rows["state"]), 4))  # noqa: B023
        assert torch.equal(made, torch.ones(4)) == bool(alone)


def test_the_critic_may_begin_alone(generator: torch.Generator) -> None:
    ppo = make(critic_first=2, lead_kl=0.1, std_learning_rate=0.1)
    policies, errors = [], []
    for _ in range(4):
        policies.append({name: weight.clone() for name, weight in ppo.model.policy.state_dict().items()})
        batch = rollout(ppo, generator)
        errors.append((ppo.model.value(batch["state"], None) - batch["return"]).square().mean().item())
        stats = ppo.update(batch, generator)
        assert (stats["policy_rate"] == 0.0) == (len(policies) <= 2)
    assert all(torch.equal(policies[2][name], weight) for name, weight in policies[0].items())
    assert any(not torch.equal(policies[3][name], weight) for name, weight in policies[0].items())
    assert errors[2] < errors[0]
