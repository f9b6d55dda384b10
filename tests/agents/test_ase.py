from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.latents import sample_sphere
from murmillo.agents.common.ppo import Minibatch, PPOConfig
from murmillo.agents.common.ranks import ALONE, Part
from murmillo.agents.common.warm_start import WarmStartConfig, warm_start
from tests.agents.toy import PointMass, make_ase, make_case, make_runner, small_ase


def train(folder: Path, **changes: object) -> list[dict[str, float]]:
    history: list[dict[str, float]] = []
    runner = make_runner(folder, num_envs=64, samples=64 * 8 * 50, **changes)  # type: ignore[arg-type]
    runner.on_iteration = [history.append]
    runner.run()
    return history


def mean(history: list[dict[str, float]], name: str) -> float:
    return sum(stats[name] for stats in history) / len(history)


def test_ase_learns_to_move_like_the_demonstrations_and_by_its_latent(tmp_path: Path) -> None:
    history = train(tmp_path)
    first, last = history[:3], history[-5:]
    # "task", minus the distance from the demonstrations' speed, has no weight: only the discriminator speaks of it
    assert mean(first, "reward/task") < -0.45
    assert mean(last, "reward/task") > -0.3
    # the encoder recovers the latent from the motion: mean cosine from 0 to more than a half
    assert mean(first, "reward/skill") < 0.15
    assert mean(last, "reward/skill") > 0.5
    # halfway the discriminator is ahead; in the end the agent deceives it
    assert mean(last, "discriminator/agent_score") > mean(history[18:23], "discriminator/agent_score") + 0.03


def test_a_task_reward_alone_is_learnt(tmp_path: Path) -> None:
    weights = {"task": 1.0, "style": 0.0, "skill": 0.0}
    history = train(tmp_path, reward_weights=weights, agent={"diversity": "none"})
    assert mean(history[:3], "reward/total") < -0.45
    assert mean(history[-5:], "reward/total") > -0.15


def test_ablations(tmp_path: Path) -> None:
    runner = make_runner(
        tmp_path, samples=1, agent={"skill_discovery": False, "diversity": "none"}, reward_weights={"style": 1.0}
    )
    stats: list[dict[str, float]] = []
    runner.on_iteration = [stats.append]
    runner.run()
    assert not {"reward/skill", "discriminator/encoder", "ppo/diversity"} & stats[0].keys()


@pytest.mark.parametrize("make", [make_ase, make_case])
def test_diversity_is_asked_of_two_different_latents(make: Callable, generator: torch.Generator) -> None:
    agent = make(PointMass(3), generator, diversity_weight=1.0)
    with torch.no_grad():
        agent.model.policy.head.weight *= 30
    rows = {"state": torch.randn(64, 4, generator=generator), "label": torch.zeros(64, dtype=torch.int64)}
    batch = Minibatch(rows, Part(ALONE, 64))
    batch["latent"] = sample_sphere(64, 4, generator)
    condition = batch["latent"] if make is make_ase else agent.condition(batch["latent"], batch["label"])
    mean = agent.model.policy(batch["state"], condition)
    loss = agent._diversity(batch, mean)["diversity"].item()
    assert loss != pytest.approx(1.0, abs=0.05)  # what the same latent twice, and so the same action, would give


@pytest.mark.parametrize("make", [make_ase, make_case])
def test_diversity_does_not_ask_for_noise(make: Callable, generator: torch.Generator) -> None:
    """By more of it two skills would differ less in units of it: the paper's form must not learn that."""
    agent = make(PointMass(3), generator, diversity="kl", ppo=replace(small_ase().ppo, std_learning_rate=1e-3))
    rows = {"state": torch.randn(64, 4, generator=generator), "label": torch.zeros(64, dtype=torch.int64)}
    batch = Minibatch(rows, Part(ALONE, 64))
    batch["latent"] = sample_sphere(64, 4, generator)
    agent._diversity(batch, torch.zeros(64, 2))["diversity"].backward()
    assert agent.model.policy.head.weight.grad is not None
    assert agent.model.policy.log_std.grad is None


@pytest.mark.parametrize("shared", [True, False])
def test_the_encoder_shares_the_discriminators_trunk_or_not(shared: bool, generator: torch.Generator) -> None:
    agent = make_ase(PointMass(3), generator, shared_trunk=shared)
    x = torch.randn(5, 12, generator=generator)
    mu = agent.encoder(x, agent.discriminator.features(x))
    torch.testing.assert_close(mu.norm(dim=1), torch.ones(5))
    mu.sum().backward()
    trunk = [parameter.grad for parameter in agent.discriminator.trunk.parameters()]
    assert all((gradient is not None) == shared for gradient in trunk)


def test_windows_of_another_length_are_refused(generator: torch.Generator) -> None:
    with pytest.raises(AgentError, match=r"agent\.window=5"):
        make_ase(PointMass(3, window=3), generator, window=5)


def test_a_misspelt_choice_lists_the_choices() -> None:
    with pytest.raises(AgentError, match=r"agent\.diversity=kll is not one of action, kl, none"):
        small_ase(diversity="kll")


def test_a_minibatch_larger_than_the_rollout_is_refused(tmp_path: Path) -> None:
    runner = make_runner(tmp_path, agent={"ppo": PPOConfig(hidden=(8,), minibatch=10_000)})
    with pytest.raises(AgentError, match=r"ppo\.minibatch=10000 is larger than the 256 samples"):
        runner.run()


def test_a_checkpoint_of_other_networks_is_refused_in_one_line(generator: torch.Generator) -> None:
    env = PointMass(3)
    state = make_ase(env, generator).state_dict()
    for changes, named in (({"latent_dim": 5}, "policy and critic"), ({"shared_trunk": False}, "encoder")):
        with pytest.raises(AgentError, match=named) as error:
            make_ase(env, generator, **changes).load_state_dict(state)
        assert "\n" not in str(error.value)


def test_warm_start_imitates(generator: torch.Generator) -> None:
    env = PointMass(3)
    agent = make_ase(env, generator)
    config = WarmStartConfig(steps=150, minibatch=64)
    critic = [parameter.clone() for parameter in agent.model.critic.parameters()]
    curve = warm_start(agent.model, env.imitation_pairs, config, generator, agent.draw_condition)
    assert len(curve) == 150
    assert curve[-1] < 0.05 * curve[0]
    assert all(torch.equal(a, b) for a, b in zip(critic, agent.model.critic.parameters(), strict=True))
