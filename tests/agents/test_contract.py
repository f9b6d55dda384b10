"""What the runner may ask of every agent. A new agent joins with one line in `AGENTS`."""

from collections.abc import Callable

import pytest
import torch

from murmillo.agents.common import checkpoint
from murmillo.agents.common.interface import Agent
from murmillo.agents.common.rollout import Rollout, tensors, true_next_obs
from tests.agents.toy import PointMass, make_ase

Maker = Callable[[PointMass, torch.Generator], Agent]
AGENTS: dict[str, Maker] = {"ase": make_ase}
HORIZON = 9


@pytest.fixture(params=list(AGENTS.values()), ids=list(AGENTS))
def make(request: pytest.FixtureRequest) -> Maker:
    return request.param


def collected(agent: Agent, env: PointMass) -> Rollout:
    """A rollout with rewards of zero, ready for an update."""
    rollout = Rollout(HORIZON, env.num_envs)
    obs = tensors(env.reset(seed=0)[0])
    for t in range(HORIZON):
        step = agent.act(obs)
        next_obs, *_, infos = env.step(step.action.numpy())
        successor = {f"next_{name}": value for name, value in true_next_obs(next_obs, infos).items()}
        seen = {name: value for name, value in {**obs, **successor}.items() if name in agent.needs}
        rollout.store(t, {**seen, **step.extras, "action": step.action, "log_prob": step.log_prob})
        obs = tensors(next_obs)
    shape = (HORIZON, env.num_envs)
    rollout["advantage"] = torch.randn(shape, generator=torch.Generator().manual_seed(1))
    rollout["return"] = rollout["advantage"] + 1
    return rollout


@pytest.mark.parametrize("num_envs", [1, 17])
def test_shapes_and_kinds(make: Maker, num_envs: int, generator: torch.Generator) -> None:
    env = PointMass(num_envs)
    agent = make(env, generator)
    obs = tensors(env.reset(seed=0)[0])
    step = agent.act(obs)
    assert step.action.shape == (num_envs, 2)
    assert step.log_prob.shape == (num_envs,)
    assert all(len(value) == num_envs for value in step.extras.values())
    assert not any(value.requires_grad for value in (step.action, step.log_prob, *step.extras.values()))
    value = agent.value(obs, step.extras)
    assert value.shape == (num_envs,)
    assert not value.requires_grad
    stacked = agent.value(
        {name: torch.stack([value, value]) for name, value in obs.items()},
        {name: torch.stack([value, value]) for name, value in step.extras.items()},
    )
    torch.testing.assert_close(stacked, torch.stack([value, value]))


def test_deterministic_actions_are_the_mean_and_draw_no_noise(make: Maker, generator: torch.Generator) -> None:
    env = PointMass(200)
    agent = make(env, generator)
    obs = tensors(env.reset(seed=0)[0])
    state = generator.get_state()
    clock = agent.state_dict()["latents"]
    clock = {name: value.clone() for name, value in clock.items()}
    first = agent.act(obs, deterministic=True)
    generator.set_state(state)
    agent.load_state_dict({**agent.state_dict(), "latents": clock})
    noisy = agent.act(obs)
    assert torch.equal(first.extras["latent"], noisy.extras["latent"])
    assert (noisy.action - first.action).mean(0).abs().max() < 0.03  # std 0.1 over 200 worlds
    assert (first.log_prob >= noisy.log_prob).all()


def test_rewards_have_the_rollouts_shape(make: Maker, generator: torch.Generator) -> None:
    env = PointMass(13)
    agent = make(env, generator)
    terms = agent.rewards(collected(agent, env))
    assert terms
    for term in terms.values():
        assert term.shape == (HORIZON, 13)
        assert term.isfinite().all()
        assert not term.requires_grad


def test_an_update_moves_the_policy_and_reports_finite_numbers(make: Maker, generator: torch.Generator) -> None:
    env = PointMass(15)  # 135 samples: a minibatch of 128 and one of 7
    agent = make(env, generator)
    rollout = collected(agent, env)
    before = agent.value({"state": rollout["state"]}, {"latent": rollout["latent"]})
    stats = agent.update(rollout)
    after = agent.value({"state": rollout["state"]}, {"latent": rollout["latent"]})
    assert all(isinstance(value, float) and torch.tensor(value).isfinite() for value in stats.values())
    assert not torch.equal(before, after)


def test_state_survives_a_checkpoint_and_goes_on_alike(make: Maker, generator: torch.Generator, tmp_path) -> None:
    env = PointMass(15)
    agent = make(env, generator)
    rollout = collected(agent, env)
    agent.update(rollout)
    checkpoint.save(tmp_path / "agent", agent.state_dict())
    other = make(env, torch.Generator().manual_seed(99))
    other.load_state_dict(checkpoint.load(tmp_path / "agent"))
    other.generator.set_state(generator.get_state())  # type: ignore[attr-defined]
    assert agent.update(rollout) == other.update(rollout)
    obs = tensors(env.reset(seed=1)[0])
    assert torch.equal(agent.act(obs).action, other.act(obs).action)
