"""C·ASE's hybrid action: probabilities by hand, and that label and latent are learnt together."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from murmillo.agents.case.high_level import HybridConfig, HybridDecoder, HybridPolicy
from murmillo.agents.common import checkpoint
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.exploration import ActionNoise
from murmillo.agents.common.latent_env import LatentEnv
from murmillo.agents.common.ppo import PPOConfig
from murmillo.agents.common.rollout import tensors
from murmillo.agents.common.runner import Runner, RunnerConfig
from tests.agents.toy import equal
from tests.agents.toy_tasks import Compass, Heading, make_commanded, make_hybrid

LOGITS = torch.tensor([0.0, math.log(2), math.log(5)])
MEAN = torch.tensor([0.3, -0.2])
STD = 0.1


def policy(gumbel: float | None = None, **changes: Any) -> HybridPolicy:
    config = PPOConfig(**{"hidden": (8,), "style_hidden": (), "std": STD, "mean_init_scale": 0.0, **changes})
    return HybridPolicy(4, 3, 2, config, torch.Generator().manual_seed(0), gumbel=gumbel)


def parameters(n: int) -> Tensor:
    return torch.cat([LOGITS, MEAN]).expand(n, -1)


def gaussian(z: Tensor) -> Tensor:
    return (-0.5 * ((z - MEAN) / STD).square() - math.log(STD) - 0.5 * math.log(2 * math.pi)).sum(-1)


def test_log_probabilities_are_the_labels_plus_the_latents() -> None:
    z = torch.tensor([[0.3, -0.2], [0.4, 0.0], [0.25, -0.3]])
    action = torch.cat([torch.eye(3), z], 1)
    label = torch.tensor([1 / 8, 2 / 8, 5 / 8]).log()
    torch.testing.assert_close(policy().log_prob(action, parameters(3)), label + gaussian(z))
    stacked = policy().log_prob(action.expand(7, 3, 5), parameters(3).expand(7, 3, 5))
    torch.testing.assert_close(stacked, (label + gaussian(z)).expand(7, 3))


def test_the_latents_std_is_learned_if_that_is_asked_for() -> None:
    assert "log_std" not in dict(policy().named_parameters())
    assert "log_std" in dict(policy(std_learning_rate=1e-3).named_parameters())


def test_the_relaxed_labels_density_is_that_of_the_concrete_distribution(generator: torch.Generator) -> None:
    """(K - 1)! tau^(K-1) prod_k (pi_k x_k^-tau) / (sum_k pi_k x_k^-tau)^K for y = log x (Maddison et al., eq. 22)."""
    tau = 0.7
    relaxed = policy(gumbel=tau)
    action = relaxed.sample(parameters(50), ActionNoise(generator))
    scores, z = action.tensor_split([3], -1)
    torch.testing.assert_close(scores.exp().sum(-1), torch.ones(50))
    weight = torch.tensor([1.0, 2, 5]) * torch.exp(-tau * scores)
    density = math.factorial(2) * tau**2 * weight.prod(-1) / weight.sum(-1) ** 3
    torch.testing.assert_close(
        relaxed.log_prob(action, parameters(50)), density.log() + gaussian(z), rtol=1e-4, atol=1e-3
    )


@pytest.mark.parametrize("gumbel", [None, 0.3])
def test_a_quiet_world_takes_the_likeliest_label(gumbel: float | None, generator: torch.Generator) -> None:
    noise = ActionNoise(generator, quiet_share=0.5)
    action, likeliest = policy(gumbel).sample(parameters(100), noise), policy(gumbel).mode(parameters(100))
    assert noise.quiet is not None
    assert torch.equal((action == likeliest).all(-1), noise.quiet)


@pytest.mark.parametrize("gumbel", [None, 0.3, 2.0])
def test_labels_come_as_often_as_their_probabilities_say(gumbel: float | None, generator: torch.Generator) -> None:
    action = policy(gumbel).sample(parameters(40_000), ActionNoise(generator))
    label = HybridDecoder(3, 2)(action).observed["skill"]
    shares = label.bincount(minlength=3) / 40_000
    torch.testing.assert_close(shares, torch.tensor([1 / 8, 2 / 8, 5 / 8]), atol=0.01, rtol=0)
    z = action[:, 3:]
    torch.testing.assert_close(z.mean(0), MEAN, atol=0.002, rtol=0)
    torch.testing.assert_close(z.std(0), torch.full((2,), STD), atol=0.002, rtol=0)


@pytest.mark.parametrize("gumbel", [None, 1.0])
def test_the_likeliest_action_entropy_and_bound(gumbel: float | None) -> None:
    one = policy(gumbel)
    command = HybridDecoder(3, 2)(one.mode(parameters(4)))
    assert (command.observed["skill"] == 2).all()
    torch.testing.assert_close(command.latent, (MEAN / MEAN.norm()).expand(4, 2))
    p = torch.tensor([1 / 8, 2 / 8, 5 / 8])
    entropy = -(p * p.log()).sum() + 2 * (math.log(STD) + 0.5 * math.log(2 * math.pi * math.e))
    torch.testing.assert_close(one.entropy(parameters(4)), entropy.expand(4))
    # logits may grow, means may not
    far = torch.tensor([[9.0, 0, 0, 1.5, -0.5]])
    assert one.bound_loss(far).item() == pytest.approx(0.25)


def test_at_first_all_labels_are_alike_and_latents_are_around_the_origin() -> None:
    assert not policy()(torch.randn(5, 4)).any()


@pytest.mark.parametrize("gumbel", [None, 1.0])
def test_gradients_reach_both_heads(gumbel: float | None, generator: torch.Generator) -> None:
    one = policy(gumbel)
    out = one(torch.randn(6, 4, generator=generator))
    one.log_prob(one.sample(out.detach(), ActionNoise(generator)), out).sum().backward()
    assert one.label_head.weight.grad is not None
    assert one.head.weight.grad is not None
    assert one.label_head.weight.grad.any()
    assert one.head.weight.grad.any()


# --- over the toy, directing what can be foreseen ---------------------------------------------------------------------


class Eastward(Heading):
    """The goal is always +x."""

    def _begin(self, worlds: np.ndarray) -> None:
        super()._begin(worlds)
        self.goal[worlds] = (1, 0)


class Backwards(Compass):
    """Under skill 1 it goes where the latent points, and nowhere under the others."""

    def act(self, obs: dict[str, Tensor], *, deterministic: bool = False) -> Any:
        step = super().act(obs, deterministic=deterministic)
        step.action[obs["skill"] != 1] = 0
        return step


def runner(folder: Path, iterations: int, seed: int = 0, gumbel: float | None = None) -> Runner:
    generator = torch.Generator().manual_seed(seed)
    env = LatentEnv(Eastward(64, skills=3, bound=9.0), Backwards(), decoder=HybridDecoder(3, 3))
    agent = make_hybrid(env, generator, gumbel=gumbel)
    weights = {"task": 1.0, "style": 0.0, "speed": 0.0}
    config = RunnerConfig(samples=iterations * 64 * 8, horizon=8, gamma=0.5, lam=0.9, reward_weights=weights)
    return Runner(env, agent, config, generator, folder)


@pytest.mark.parametrize("gumbel", [None, 1.0])
def test_label_and_latent_are_learnt_together(gumbel: float | None, tmp_path: Path) -> None:
    training = runner(tmp_path, 25, gumbel=gumbel)
    training.run()
    assert isinstance(training.env, LatentEnv)
    obs = tensors(training.env.reset(seed=1)[0])
    command = training.env.decoder(training.agent.act(obs, deterministic=True).action)
    assert (command.observed["skill"] == 1).all()
    assert command.latent[:, 0].mean() < -0.8  # the Compass turns under skill 1


@pytest.mark.parametrize("gumbel", [None, 1.0])
def test_n_and_n_more_iterations_are_2n_bit_for_bit(gumbel: float | None, tmp_path: Path) -> None:
    runner(tmp_path / "whole", 4, gumbel=gumbel).run()
    runner(tmp_path / "half", 2, gumbel=gumbel).run()
    second = runner(tmp_path / "half", 4, seed=77, gumbel=gumbel)
    second.load(tmp_path / "half")
    second.run()
    assert equal(checkpoint.load(tmp_path / "whole"), checkpoint.load(tmp_path / "half"))


def test_a_user_gives_the_label_and_the_latent_alone_is_learnt(tmp_path: Path) -> None:
    """The Compass turns under skill 1, so that the right latent depends on the label that is commanded."""
    generator = torch.Generator().manual_seed(0)
    env = LatentEnv(Eastward(64, skills=2, bound=9.0), Compass())
    agent = make_commanded(env, generator)
    assert env.single_action_space.shape == (3,)
    weights = {"task": 1.0, "style": 0.0, "speed": 0.0}
    config = RunnerConfig(samples=25 * 64 * 8, horizon=8, gamma=0.5, lam=0.9, reward_weights=weights)
    Runner(env, agent, config, generator, tmp_path).run()
    obs = tensors(env.reset(seed=1)[0])
    latent = env.decoder(agent.act(obs, deterministic=True).action).latent
    assert latent[obs["skill"] == 0, 0].mean() > 0.8
    assert latent[obs["skill"] == 1, 0].mean() < -0.8


def test_impossible_settings_are_refused(generator: torch.Generator) -> None:
    with pytest.raises(AgentError, match=r"agent\.gumbel=0\.0 is no temperature"):
        HybridConfig(gumbel=0.0)
