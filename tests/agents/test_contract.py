"""What the runner may ask of every agent, and more of those that act under latents and have a discriminator.

A new agent joins with one line in `LOW_LEVEL` or `AGENTS`.
"""

import copy
import dataclasses
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from murmillo.agents.common import checkpoint
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Agent, MultiObjective, Steerable
from murmillo.agents.common.rollout import Rollout, tensors, true_next_obs
from murmillo.agents.common.runner import Runner
from tests.agents.toy import PointMass, equal, make_ase, make_calm, make_case, make_runner, small_ase
from tests.agents.toy_adapted import adapted
from tests.agents.toy_adaptnet import make_adaptnet
from tests.agents.toy_tasks import make_commanded, make_task

Maker = Callable[..., Agent]
HINGE = {"discriminator": replace(small_ase().discriminator, loss="hinge")}
LOW_LEVEL: dict[str, Maker] = {"ase": make_ase, "calm": make_calm, "case": make_case}
LOW_LEVEL |= {f"{name}_adapted": adapted(name) for name in list(LOW_LEVEL)}
LOW_LEVEL["case_hinge"] = lambda env, generator, **changes: make_case(env, generator, **{**HINGE, **changes})
AGENTS: dict[str, Maker] = {**LOW_LEVEL, "adaptnet": make_adaptnet, "task": make_task, "commanded": make_commanded}
REWARDS = {
    "ase": {"style": 1.0, "skill": 0.5},
    "calm": {"style": 1.0},
    "case": {"style": 1.0, "skill": 0.5},
    "case_hinge": {"style": 1.0, "skill": 0.5},
    "adaptnet": {"task": 0.5, "imitation": 0.5},
    "task": {"task": 1.0},
    "commanded": {"task": 1.0},
}
REWARDS |= {f"{name}_adapted": REWARDS[name] for name in ("ase", "calm", "case")}
"""What each counts on."""
HORIZON = 9


@pytest.fixture(params=list(AGENTS.values()), ids=list(AGENTS))
def make(request: pytest.FixtureRequest) -> Maker:
    return request.param


@pytest.fixture(params=list(LOW_LEVEL.values()), ids=list(LOW_LEVEL))
def make_low(request: pytest.FixtureRequest) -> Maker:
    return request.param


@pytest.fixture(params=[1, 3], ids=["one_label", "three_labels"])
def skills(request: pytest.FixtureRequest) -> int:
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
    rollout["return"] = torch.randn(*shape, *critics(agent), generator=torch.Generator().manual_seed(1)) + 1
    return rollout


def critics(agent: Agent) -> list[int]:
    """The dimensions of a value behind those of its state."""
    return [len(agent.objectives)] if isinstance(agent, MultiObjective) else []


def values(agent: Agent, env: PointMass, rollout: Rollout) -> torch.Tensor:
    """[T, N] of the rollout's states, under what acted in them."""
    extras = agent.act(tensors(env.reset(seed=0)[0])).extras
    obs = {name: rollout[name] for name in agent.needs if not name.startswith("next_")}
    return agent.value(obs, {name: rollout[name] for name in extras})


@pytest.mark.parametrize("num_envs", [1, 17])
def test_shapes_and_kinds(make: Maker, skills: int, num_envs: int, generator: torch.Generator) -> None:
    env = PointMass(num_envs, skills=skills)
    agent = make(env, generator)
    obs = tensors(env.reset(seed=0)[0])
    step = agent.act(obs)
    assert step.action.shape == (num_envs, 2)
    assert step.log_prob.shape == (num_envs,)
    assert all(len(value) == num_envs for value in step.extras.values())
    assert not any(value.requires_grad for value in (step.action, step.log_prob, *step.extras.values()))
    value = agent.value(obs, step.extras)
    assert list(value.shape) == [num_envs, *critics(agent)]
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
    before, drawn = copy.deepcopy(agent.state_dict()), generator.get_state()
    first = agent.act(obs, deterministic=True)
    agent.load_state_dict(before)
    generator.set_state(drawn)
    noisy = agent.act(obs)
    assert all(torch.equal(first.extras[name], noisy.extras[name]) for name in first.extras)
    assert (noisy.action - first.action).mean(0).abs().max() < 0.03  # std 0.1 over 200 worlds
    assert (first.log_prob >= noisy.log_prob).all()
    agent.load_state_dict(before)
    generator.set_state(drawn)
    assert torch.equal(first.action, agent.act(obs, deterministic=True).action)


def test_a_reset_begins_anew_in_its_worlds_only(make_low: Maker, generator: torch.Generator) -> None:
    env = PointMass(30)
    agent = make_low(env, generator, latent_steps=(50, 50))
    obs = tensors(env.reset(seed=0)[0])
    before = agent.act(obs).extras["latent"]
    agent.reset(torch.arange(10))
    changed = (agent.act(obs).extras["latent"] != before).any(-1)
    assert changed[:10].all()
    assert not changed[10:].any()


def test_latents_that_are_followed_stay_until_the_reset(make_low: Maker, generator: torch.Generator) -> None:
    env = PointMass(5)
    agent = make_low(env, generator)
    assert isinstance(agent, Steerable)
    obs = tensors(env.reset(seed=0)[0])
    asked = agent.draw_latents(5)
    assert asked.shape == (5, agent.latent_dim)
    torch.testing.assert_close(asked.norm(dim=-1), torch.ones(5))
    agent.follow(asked)
    for _ in range(200):  # longer than any latent lasts by itself
        assert torch.equal(agent.act(obs, deterministic=True).extras["latent"], asked)
    agent.follow(asked[0])
    assert torch.equal(agent.act(obs).extras["latent"], asked[0].expand(5, -1))
    agent.reset(torch.tensor([1, 3]))
    same = (agent.act(obs).extras["latent"] == asked[0]).all(-1)
    assert same.tolist() == [True, False, True, False, True]


@pytest.mark.parametrize("name", AGENTS)
def test_rewards_have_the_rollouts_shape(name: str, skills: int, generator: torch.Generator) -> None:
    env = PointMass(13, skills=skills)
    agent = AGENTS[name](env, generator)
    terms = agent.rewards(collected(agent, env))
    assert set(terms) == set(REWARDS[name]) - {"task"}
    for term in terms.values():
        assert term.shape == (HORIZON, 13)
        assert term.isfinite().all()
        assert not term.requires_grad


@pytest.mark.parametrize("num_envs", [1, 15])
def test_an_update_moves_the_policy_and_reports_finite_numbers(
    make: Maker, skills: int, num_envs: int, generator: torch.Generator
) -> None:
    env = PointMass(num_envs, skills=skills)
    ppo = dataclasses.replace(small_ase().ppo, minibatch=min(128, 4 * num_envs))  # the last of an epoch is smaller
    agent = make(env, generator, ppo=ppo)
    rollout = collected(agent, env)
    before = values(agent, env, rollout)
    stats = agent.update(rollout)
    assert all(isinstance(value, float) and torch.tensor(value).isfinite() for value in stats.values())
    assert not torch.equal(before, values(agent, env, rollout))


def test_nothing_is_learned_from_rows_that_are_left_out(make: Maker, skills: int, generator: torch.Generator) -> None:
    env = PointMass(17, skills=skills)
    agent = make(env, generator)
    rollout = collected(agent, env)
    left_out = torch.zeros(rollout.shape, dtype=torch.bool)
    left_out[2, 3] = left_out[7, 0] = True
    rollout["advantage"][left_out] = torch.nan
    rollout.leave_out(left_out)
    assert all(torch.tensor(value).isfinite() for value in agent.update(rollout).values())


def test_the_discriminator_remembers_earlier_iterations(make_low: Maker, generator: torch.Generator) -> None:
    env = PointMass(15)
    agent = make_low(env, generator, discriminator=small_ase().discriminator)
    first, second = (agent.update(collected(agent, env)) for _ in range(2))
    assert first["discriminator/replay"] == pytest.approx(first["discriminator/agent"])  # nothing to remember yet
    assert second["discriminator/replay"] != pytest.approx(second["discriminator/agent"], rel=1e-3)


def test_the_discriminators_scale_is_that_of_clips_and_agent(make_low: Maker, generator: torch.Generator) -> None:
    """From the clips before the first judgement, from both after each update."""
    env = PointMass(15)
    agent: Any = make_low(env, generator)
    clips = agent.config.discriminator.minibatch * env.window
    normalizer = agent.discriminator.normalizer
    assert normalizer.count == clips
    agent.update(collected(agent, env))
    assert normalizer.count == 2 * clips + HORIZON * 15


def test_state_survives_a_checkpoint_and_goes_on_alike(
    make: Maker, skills: int, generator: torch.Generator, tmp_path: Path
) -> None:
    env = PointMass(15, skills=skills)
    agent = make(env, generator)
    agent.update(collected(agent, env))
    checkpoint.save(tmp_path / "agent", agent.state_dict())
    other = make(env, torch.Generator().manual_seed(99))
    other.load_state_dict(checkpoint.load(tmp_path / "agent"))
    drawn = generator.get_state()
    stats = agent.update(collected(agent, env))
    other.generator.set_state(drawn)  # type: ignore[attr-defined]
    assert stats == other.update(collected(other, env))
    obs = tensors(env.reset(seed=1)[0])
    assert torch.equal(agent.act(obs).action, other.act(obs).action)


def test_a_state_that_lacks_a_part_is_refused_in_one_line(make_low: Maker, generator: torch.Generator) -> None:
    agent = make_low(PointMass(3), generator)
    state = agent.state_dict()
    del state["optimizer"], state["latents"]
    with pytest.raises(AgentError, match="the checkpoint has no latents, optimizer") as error:
        agent.load_state_dict(state)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", AGENTS)
def test_n_and_n_more_iterations_are_2n_bit_for_bit(name: str, tmp_path: Path) -> None:
    def runner(folder: Path, iterations: int, seed: int = 0) -> Runner:
        samples, weights = iterations * 32 * 8, REWARDS[name]
        return make_runner(folder, make=AGENTS[name], skills=3, seed=seed, samples=samples, reward_weights=weights)

    runner(tmp_path / "whole", 4).run()
    runner(tmp_path / "half", 2).run()
    second = runner(tmp_path / "half", 4, seed=77)
    second.load(tmp_path / "half")
    second.run()
    assert equal(checkpoint.load(tmp_path / "whole"), checkpoint.load(tmp_path / "half"))
