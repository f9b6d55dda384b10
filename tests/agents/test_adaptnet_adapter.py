import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from murmillo.agents.adaptnet.agent import AdaptNet
from murmillo.agents.common import checkpoint
from murmillo.agents.common.adapter import INJECTION, AdaptedPolicy, Adapter, AdapterConfig, affine
from murmillo.agents.common.base import Base
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.exploration import ActionNoise
from murmillo.agents.common.interface import Obs
from murmillo.agents.common.networks import GaussianPolicy
from murmillo.agents.common.rollout import tensors
from tests.agents.toy_adaptnet import Wanderer, make_adaptnet, make_base

CONFIGS = {
    "adaptnet": AdapterConfig(),
    "low_rank": AdapterConfig(rank=2),
    "injection_only": AdapterConfig(internal=False),
    "no_own_encoder": AdapterConfig(own_encoder=False),
    "internal_only": AdapterConfig(injection=()),
    "z1": AdapterConfig(injection=(1,), internal=False),
    "z0_and_z1": AdapterConfig(injection=(0, 1)),
    "all": AdapterConfig(injection=(0, 1, 2), internal=False),
}
MERGEABLE = [name for name in CONFIGS if name != "all"]


def observe(env: Wanderer, steps: int = 2) -> Obs:
    """Worlds whose histories are of different lengths, since some have just begun anew."""
    obs, _ = env.reset(seed=3)
    for _ in range(steps):
        obs, *_ = env.step(torch.randn(env.num_envs, 2, generator=torch.Generator().manual_seed(1)).numpy())
    return tensors(obs)


def adapted(adapter: str = "adaptnet", base: Base | None = None, *, seed: int = 5, **env: Any) -> AdaptNet:
    generator = torch.Generator().manual_seed(seed)
    return make_adaptnet(Wanderer(16, **env), generator, base or make_base(), adapter=CONFIGS[adapter])


def shake(agent: AdaptNet, seed: int = 9) -> AdaptedPolicy:
    """Move all that training would move."""
    policy, generator = agent.model.policy, torch.Generator().manual_seed(seed)
    assert isinstance(policy, AdaptedPolicy)
    with torch.no_grad():
        for parameter in policy.adapters.parameters():  # type: ignore[attr-defined]  # it is a ModuleList too
            parameter += 0.1 * torch.randn(parameter.shape, generator=generator)
    scale = torch.tensor([3.0, 1, 2, 1])
    agent.model.state_normalizer.update(scale * torch.randn(300, 4, generator=generator))
    return policy


def mean_action(agent: AdaptNet, obs: Obs) -> Tensor:
    return agent.act(obs, deterministic=True).action


@pytest.mark.parametrize("heights", [False, True], ids=["flat", "map"])
@pytest.mark.parametrize("name", CONFIGS)
def test_before_training_it_acts_as_its_base_to_the_last_bit(name: str, heights: bool) -> None:
    base, env = make_base(), Wanderer(16, heights=heights)
    before = make_adaptnet(Wanderer(16), torch.Generator().manual_seed(1))
    before.model.policy.load_state_dict(base.policy)
    before.model.state_normalizer.load_state_dict(base.normalizer)
    after = make_adaptnet(env, torch.Generator().manual_seed(2), base, adapter=CONFIGS[name])
    obs = observe(env)
    for deterministic in (True, False):
        steps = []
        for agent in (before, after):
            agent.noise.generator = torch.Generator().manual_seed(7)
            steps.append(agent.act(obs, deterministic=deterministic))
        assert torch.equal(steps[0].action, steps[1].action)
        assert torch.equal(steps[0].log_prob, steps[1].log_prob)


def test_alpha_goes_from_the_base_to_the_adapted_policy() -> None:
    agent = adapted()
    obs = observe(Wanderer(16))
    base_action = mean_action(agent, obs)
    policy = shake(agent)
    full = mean_action(agent, obs)
    agent.blend(0.0)
    assert torch.equal(mean_action(agent, obs), base_action)
    agent.blend(1.0)
    assert torch.equal(mean_action(agent, obs), full)
    assert not torch.allclose(full, base_action, atol=0.05)
    views, told = agent.model.state_normalizer(obs["state"]), agent.observed.beside(obs)
    ends = []
    for alpha in (0.0, 1.0, 0.25):
        agent.blend(alpha)
        ends.append(policy.encode(views, told))
    torch.testing.assert_close(ends[2], torch.lerp(ends[0], ends[1], 0.25))  # eq. 13
    torch.testing.assert_close(ends[1] - ends[0], policy.injection(views, told))


def test_two_adapters_are_blended() -> None:
    one, two, both = adapted(), adapted("low_rank"), adapted()
    for agent, seed in ((one, 9), (two, 10), (both, 9)):
        shake(agent, seed)
    both.join(two)
    obs = observe(Wanderer(16))
    for alpha, alone in ((1.0, one), (0.0, two)):
        both.blend(alpha)
        torch.testing.assert_close(mean_action(both, obs), mean_action(alone, obs))
    both.blend(0.5)
    policy, views, told = both.model.policy, both.model.state_normalizer(obs["state"]), both.observed.beside(obs)
    assert isinstance(policy, AdaptedPolicy)
    known = {**told, INJECTION: policy.injection(views, told)}  # of the first one only
    torch.testing.assert_close(policy(views, known), policy(views, told))
    assert not torch.allclose(mean_action(both, obs), mean_action(one, obs), atol=0.02)
    with pytest.raises(AgentError, match="two adapters at most"):
        both.join(one)


@pytest.mark.parametrize(
    ("heights", "seen"), [(False, False), (True, False), (True, True)], ids=["flat", "map", "old_map"]
)
@pytest.mark.parametrize("name", MERGEABLE)
def test_merged_it_acts_the_same(name: str, heights: bool, seen: bool) -> None:
    """Whether there is no map, one that is new, or one that the base has seen already."""
    agent = adapted(name, make_base(heights=seen), heights=heights)
    shake(agent)
    agent.blend(0.7)
    obs = observe(Wanderer(16, heights=heights))
    told, views = agent.observed.beside(obs), agent.model.state_normalizer(obs["state"])
    before = agent.model.policy(views, told)
    agent.merge()
    assert not isinstance(agent.model.policy, AdaptedPolicy)
    torch.testing.assert_close(agent.model.policy(views, told), before, atol=1e-5, rtol=0)


def test_two_are_merged_as_they_are_blended() -> None:
    agent, other = adapted(), adapted("z0_and_z1", seed=6)
    shake(agent, 9)
    shake(other, 10)
    agent.join(other)
    agent.blend(0.3)
    obs = observe(Wanderer(16))
    before = mean_action(agent, obs)
    agent.merge()
    torch.testing.assert_close(mean_action(agent, obs), before, atol=1e-5, rtol=0)


@pytest.mark.parametrize(
    ("heights", "seen"), [(False, False), (True, False), (True, True)], ids=["flat", "map", "old_map"]
)
def test_a_merged_checkpoint_stands_alone(heights: bool, seen: bool, tmp_path: Path) -> None:
    """It asks for no base, and takes in none that it is not."""
    agent = adapted("z0_and_z1", make_base(heights=seen), heights=heights)
    shake(agent)
    agent.merge()
    checkpoint.save(tmp_path, {"agent": agent.state_dict()})
    state = checkpoint.load(tmp_path)["agent"]
    again = make_adaptnet(Wanderer(16, heights=heights), torch.Generator(), Base.within(state))
    again.load_state_dict(state)
    obs = observe(Wanderer(16, heights=heights))
    assert torch.equal(mean_action(again, obs), mean_action(agent, obs))
    assert torch.equal(again.value(obs, {}), agent.value(obs, {}))
    with pytest.raises(AgentError, match="has other layers than the config's"):
        adapted(base=make_base(heights=seen), heights=heights).load_state_dict(state)


def test_what_cannot_be_merged_says_so() -> None:
    with pytest.raises(AgentError, match=r"shifts the latent space 2 cannot be merged; 0 and 1 can"):
        adapted("all").merge()
    with pytest.raises(AgentError, match="a policy without adapters cannot be merged"):
        make_adaptnet(Wanderer(3), torch.Generator()).merge()


def test_low_rank_is_low(generator: torch.Generator) -> None:
    policy = shake(adapted("low_rank"))
    weight, _ = affine(policy.adapters[0].adaptors[1])
    assert torch.linalg.matrix_rank(weight) == 2
    full, _ = affine(shake(adapted()).adapters[0].adaptors[1])
    assert torch.linalg.matrix_rank(full) > 25
    base, tall = make_base(), AdapterConfig(rank=19)
    with pytest.raises(AgentError, match=r"agent\.adapter\.rank=19: a layer has rank 18 at most; 0 is full rank"):
        make_adaptnet(Wanderer(3), generator, base, adapter=tall)


def test_locked_joints_take_their_outputs_away(generator: torch.Generator) -> None:
    base = make_base()
    env = Wanderer(16)
    obs = observe(env)
    whole = make_adaptnet(env, generator, base)
    mean, log_std = whole.model.policy.moments(
        whole.model.policy(whole.model.state_normalizer(obs["state"]), whole.observed.beside(obs))
    )
    env.single_action_space = copy.deepcopy(env.single_action_space)
    env.single_action_space._shape = (1,)  # type: ignore[attr-defined]  # one of two joints is left
    with pytest.raises(AgentError, match="the base acts with 2 numbers, the environment takes 1") as error:
        make_adaptnet(env, generator, base)
    assert "\n" not in str(error.value)
    less = make_adaptnet(env, generator, base.pruned([1]))
    kept = less.model.policy.moments(
        less.model.policy(less.model.state_normalizer(obs["state"]), less.observed.beside(obs))
    )
    torch.testing.assert_close(kept, (mean[:, 1:], log_std[:, 1:]))
    assert base.pruned([1]).digest != base.digest


@pytest.mark.parametrize(
    ("outputs", "line"), [([0, 2], "no output 2 to keep; the policy has 0 to 1"), ([1, 1], "each once"), ([], "named")]
)
def test_outputs_that_there_are_not(outputs: list[int], line: str) -> None:
    with pytest.raises(AgentError, match=line):
        make_base().pruned(outputs)


def test_another_base_is_refused_in_one_line() -> None:
    one, other = adapted(base=make_base(0)), adapted(base=make_base(1))
    refused: list[Callable[[], None]] = [
        lambda: one.load_state_dict(other.state_dict()),
        lambda: one.join(other),
        lambda: make_adaptnet(Wanderer(16), torch.Generator()).load_state_dict(one.state_dict()),
    ]
    for attempt in refused:
        with pytest.raises(AgentError, match="the adapter's base is another policy") as error:
            attempt()
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("alpha", [-0.1, 1.1, float("nan")])
def test_alpha_outside_is_refused(alpha: float) -> None:
    with pytest.raises(AgentError, match=rf"alpha={alpha}: 0 is without the adapter, 1 with all of it"):
        adapted().blend(alpha)


def test_nothing_to_adapt_with_is_refused() -> None:
    with pytest.raises(AgentError, match="nothing to adapt with"):
        AdapterConfig(injection=(), internal=False)
    with pytest.raises(AgentError, match=r"injection=\[3\]: the policy has the latent spaces 0 to 2"):
        make_adaptnet(Wanderer(3), torch.Generator(), make_base(), adapter=AdapterConfig(injection=(3,)))


def test_the_policies_of_the_other_methods_are_adapted_alike(generator: torch.Generator) -> None:
    """A policy under latents, as ASE, CALM and C·ASE have it: fully connected, with a style network."""
    base = GaussianPolicy(5, 3, (16, 16), 0.1, generator, condition_dim=4, style_hidden=(8,))
    state, latent = torch.randn(7, 5, generator=generator), torch.randn(7, 4, generator=generator)
    before = base(state, latent)
    policy = AdaptedPolicy(base, Adapter(base, AdapterConfig(), generator))
    views = torch.cat([state, state], -1)
    assert torch.equal(policy(views, latent), before)
    noise, same_noise = (ActionNoise(torch.Generator().manual_seed(1)) for _ in range(2))
    assert torch.equal(policy.sample(before, noise), base.sample(before, same_noise))
    optimizer = torch.optim.Adam([p for p in policy.parameters() if p.requires_grad], lr=1e-2)
    target = before.detach() + 1
    for _ in range(100):
        loss = nn.functional.mse_loss(policy(views, latent), target)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss.item() < 0.1
    assert torch.equal(base(state, latent), before)  # which is what it was
