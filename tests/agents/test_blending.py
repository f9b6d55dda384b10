"""Part of an adaptation of ASE, CALM and C·ASE, two at once, and what they are merged into: AdaptNet's ways for all."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from murmillo.agents.common import checkpoint
from murmillo.agents.common.adapter import AdaptedPolicy, AdapterConfig
from murmillo.agents.common.base import Base
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Obs
from tests.agents.test_contract import collected
from tests.agents.toy import PointMass, small_ase
from tests.agents.toy_adapted import KINDS, base_of, make, make_adapted, make_parent, shake

SKILLS, WORLDS = 3, 32
STYLED = {"ppo": replace(small_ase().ppo, hidden=(32, 24), style_hidden=(8,), std_learning_rate=1e-3)}
CONFIGS = {
    "adaptnet": AdapterConfig(),
    "low_rank": AdapterConfig(rank=2),
    "no_own_encoder": AdapterConfig(own_encoder=False),
    "internal_only": AdapterConfig(injection=()),
    "z1": AdapterConfig(injection=(1,), internal=False),
    "z0_and_z1": AdapterConfig(injection=(0, 1)),
}


@pytest.fixture(params=list(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


def anything(heights: bool = False, n: int = WORLDS) -> Obs:
    """What no world may show: states from hardly any to beyond all that a normaliser lets through, on wild ground."""
    drawn = torch.Generator().manual_seed(1)
    scale = torch.logspace(-2, 4, n)[:, None]
    obs = {
        "state": scale * torch.randn(n, 4, generator=drawn),
        "skill": torch.randint(SKILLS, (n,), generator=drawn),
    }
    return obs | ({"heights": torch.randn(n, 35, 35, generator=drawn)} if heights else {})


def adapted(kind: str, *, heights: bool = False, scale: float = 0.1, seed: int = 9, **changes: Any) -> Any:
    """An adaptation that has learned, of a base that is the same for all of a kind."""
    agent = make_adapted(kind, PointMass(WORLDS, skills=SKILLS, heights=heights), torch.Generator(), **changes)
    shake(agent, scale, seed)
    agent.model.state_normalizer.update(torch.randn(300, 4, generator=torch.Generator().manual_seed(seed)))
    return agent


def act(agent: Any, obs: Obs, latent: Tensor) -> Tensor:
    agent.follow(latent)
    return agent.act(obs, deterministic=True).action


def latents() -> Tensor:
    return torch.nn.functional.normalize(torch.randn(WORLDS, 4, generator=torch.Generator().manual_seed(3)), dim=-1)


# --- blended ---------------------------------------------------------------------------------------------------------


def test_alpha_goes_from_the_base_to_the_adaptation_to_the_last_bit(kind: str) -> None:
    parent = make(kind, PointMass(WORLDS, skills=SKILLS), torch.Generator())
    parent.load_state_dict(
        {**make_parent(kind, SKILLS).state_dict(), **{n: parent.state_dict()[n] for n in ("latents", "replay")}}
    )
    agent, obs, z = adapted(kind), anything(), latents()
    whole = act(agent, obs, z)
    assert agent.adapters == 1
    agent.blend(0.0)
    assert torch.equal(act(agent, obs, z), act(parent, obs, z))
    agent.blend(1.0)
    assert torch.equal(act(agent, obs, z), whole)
    agent.blend(0.5)
    half = act(agent, obs, z)
    assert all((half - end).abs().max() > 0.02 for end in (whole, act(parent, obs, z)))


def test_two_adapters_are_blended_while_it_acts(kind: str) -> None:
    one, other, both = adapted(kind), adapted(kind, seed=10), adapted(kind)
    both.join(other)
    obs, z = anything(), latents()
    for alpha, alone in ((1.0, one), (0.0, other)):
        both.blend(alpha)
        torch.testing.assert_close(act(both, obs, z), act(alone, obs, z))
    both.blend(0.5)
    assert both.adapters == 2
    assert not torch.allclose(act(both, obs, z), act(one, obs, z), atol=0.02)
    with pytest.raises(AgentError, match="two adapters at most"):
        both.join(one)
    rollout = collected(both, PointMass(WORLDS, skills=SKILLS))
    with pytest.raises(AgentError, match="is for playing and learns no more"):
        both.update(rollout)


@pytest.mark.parametrize("alpha", [-0.1, 1.1, float("nan")])
def test_alpha_outside_is_refused(alpha: float) -> None:
    with pytest.raises(AgentError, match=rf"alpha={alpha}: 0 is without the adapter, 1 with all of it"):
        adapted("ase").blend(alpha)


def test_what_cannot_be_joined_says_so_in_one_line() -> None:
    ase = adapted("ase")
    elsewhere = make("ase", PointMass(3), torch.Generator(), base_of(make_parent("ase", seed=8)))
    refused = {
        "the adapter's base is another policy": lambda: ase.join(elsewhere),
        "an adapter of CALM is none of ASE": lambda: ase.join(adapted("calm")),
        "its adapter sees heights, which this one's world does not show": lambda: ase.join(
            adapted("ase", heights=True)
        ),
        "a policy without adapters cannot be joined; name a run that adapts": lambda: ase.join(make_parent("ase")),
        "a policy without adapters cannot be blended": lambda: make_parent("ase").blend(0.5),
    }
    for line, attempt in refused.items():
        with pytest.raises(AgentError, match=line) as error:
            attempt()
        assert "\n" not in str(error.value)
        assert ase.adapters == 1


# --- merged ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("heights", [False, True], ids=["flat", "map"])
@pytest.mark.parametrize("name", CONFIGS)
def test_merged_it_acts_the_same_whatever_it_sees(kind: str, name: str, heights: bool) -> None:
    changes: Any = STYLED if name in ("adaptnet", "z0_and_z1") else {}
    agent = adapted(kind, heights=heights, adapter=CONFIGS[name], **changes)
    agent.blend(0.7)
    obs, z = anything(heights), latents()
    before = act(agent, obs, z)
    agent.merge()
    assert agent.adapters == 0
    assert not [name for name, _ in agent.model.named_modules() if "adapter" in name or "adaptor" in name]
    torch.testing.assert_close(act(agent, obs, z), before, atol=1e-5, rtol=0)


@pytest.mark.parametrize("heights", [False, True], ids=["flat", "map"])
def test_two_are_merged_as_they_are_blended(kind: str, heights: bool) -> None:
    agent = adapted(kind, heights=heights, adapter=CONFIGS["no_own_encoder"])
    other = adapted(kind, heights=heights, adapter=CONFIGS["z0_and_z1"], seed=10)
    agent.join(other)
    agent.blend(0.3)
    obs, z = anything(heights), latents()
    before = act(agent, obs, z)
    agent.merge()
    torch.testing.assert_close(act(agent, obs, z), before, atol=1e-5, rtol=0)


@pytest.mark.parametrize("heights", [False, True], ids=["flat", "map"])
def test_a_merged_checkpoint_stands_alone(kind: str, heights: bool, tmp_path: Path) -> None:
    """With all that gives latents, labels and motions their meaning, and none of what is for learning."""
    changes: Any = {"ppo": replace(STYLED["ppo"], epochs=1)} if heights else {}
    agent = adapted(kind, heights=heights, **changes)
    rollout = collected(agent, PointMass(WORLDS, skills=SKILLS, heights=heights))
    agent.update(rollout)
    agent.merge()
    checkpoint.save(tmp_path, {"agent": agent.state_dict()})
    state = checkpoint.load(tmp_path)["agent"]
    env = PointMass(WORLDS, skills=SKILLS, heights=heights)
    again = make(kind, env, torch.Generator().manual_seed(4), Base.within(state), **changes)
    again.load_state_dict({**state, "latents": again.state_dict()["latents"]})
    obs, z = anything(heights), latents()
    assert torch.equal(act(again, obs, z), act(agent, obs, z))
    theirs, ours = (one.rewards(rollout) for one in (agent, again))
    assert theirs.keys() == ours.keys()
    assert all(torch.equal(theirs[name], ours[name]) for name in theirs)
    assert not state["ppo"]["optimizer"]
    assert not state["optimizer"]
    with pytest.raises(AgentError, match="is for playing and learns no more"):
        again.update(rollout)
    with pytest.raises(AgentError, match="a policy without adapters cannot be merged"):
        again.merge()
    with pytest.raises(AgentError, match="base: this is no policy that was trained from nothing"):
        base_of(again)


def test_what_cannot_be_merged_stays_as_it_is(kind: str) -> None:
    deep = {"adapter": AdapterConfig(injection=(0, 2)), "ppo": replace(small_ase().ppo, hidden=(16, 16))}
    agent = adapted(kind, heights=True, **deep)
    with pytest.raises(AgentError, match=r"shifts the latent space 2 cannot be merged; 0 and 1 can.*injection"):
        agent.merge()
    assert isinstance(agent.model.policy, AdaptedPolicy)
    with pytest.raises(AgentError, match="a policy without adapters cannot be merged"):
        make_parent(kind).merge()


# --- what it is told -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("merged", [False, True], ids=["adapted", "merged"])
def test_latents_labels_and_encodings_are_told_as_to_the_base(kind: str, merged: bool) -> None:
    """Two latents, or two labels, part the actions in the direction in which they part them in the base."""
    agent, obs = adapted(kind, scale=0.02), anything()
    obs["state"] = torch.randn(WORLDS, 4, generator=torch.Generator().manual_seed(2))
    parent = adapted(kind, scale=0.0)
    if merged:
        agent.merge()
    z = latents()
    told = [(obs, z), (obs, z.roll(1, 0)), (obs | {"skill": (obs["skill"] + 1) % SKILLS}, z)]
    own, ours = ([act(one, *each) for each in told] for one in (parent, agent))
    for number in (1, 2):
        apart, now = own[0] - own[number], ours[0] - ours[number]
        if number == 2 and kind != "case":  # who is told no label heeds none
            assert torch.equal(now, torch.zeros_like(now))
            continue
        assert apart.abs().max() > 0.05
        assert torch.cosine_similarity(apart.flatten(), now.flatten(), 0) > 0.8
    if kind == "calm":
        motions = parent._draw_motions(9).window
        assert torch.equal(agent.encode(motions), parent.encode(motions))
