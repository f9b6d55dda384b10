"""ASE, CALM and C·ASE adapted: what of the base stays, what learns, and what latents and labels go on meaning."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from murmillo.agents.common import checkpoint
from murmillo.agents.common.adapter import INJECTION, AdaptedPolicy, AdapterConfig
from murmillo.agents.common.base import EYE, Base
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Obs
from murmillo.agents.common.ppo import Minibatch
from murmillo.agents.common.ranks import ALONE, Part
from murmillo.agents.common.rollout import tensors
from murmillo.agents.common.runner import Runner
from murmillo.agents.common.skill_discovery import diversity_loss
from tests.agents.test_contract import REWARDS, collected
from tests.agents.toy import PointMass, equal, make_runner, small_ase
from tests.agents.toy_adapted import KINDS, adapted, base_of, copies, make, make_adapted, make_parent, shake

SKILLS = 3
STYLED = {"ppo": replace(small_ase().ppo, style_hidden=(8,), std_learning_rate=1e-3)}


@pytest.fixture(params=list(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


def observe(heights: bool = False, num_envs: int = 16) -> tuple[PointMass, Obs]:
    env = PointMass(num_envs, skills=SKILLS, heights=heights)
    env.reset(seed=3)
    obs, *_ = env.step(torch.randn(num_envs, 2, generator=torch.Generator().manual_seed(1)).numpy())
    return env, tensors(obs)


def acted(agent: Any, obs: Obs, latent: Tensor) -> list[Tensor]:
    """Likeliest actions, and drawn ones with their log probabilities, under this latent."""
    agent.follow(latent)
    agent.noise.generator = torch.Generator().manual_seed(5)
    drawn = agent.act(obs)
    return [agent.act(obs, deterministic=True).action, drawn.action, drawn.log_prob]


def runner(kind: str, folder: Path, iterations: int = 2) -> Runner:
    samples, weights = iterations * 32 * 8, REWARDS[kind]
    return make_runner(folder, make=adapted(kind), skills=SKILLS, samples=samples, reward_weights=weights)


@pytest.mark.parametrize("heights", [False, True], ids=["flat", "map"])
@pytest.mark.parametrize("changes", [{}, STYLED], ids=["plain", "styled"])
def test_before_training_it_acts_as_its_base_to_the_last_bit(
    kind: str, changes: dict, heights: bool, tmp_path: Path
) -> None:
    parent = make_parent(kind, SKILLS, **changes)
    checkpoint.save(tmp_path / "base", {"agent": parent.state_dict()})
    env, obs = observe(heights)
    agent = make(kind, env, torch.Generator().manual_seed(2), Base.load(tmp_path / "base"), **changes)
    latent = parent.draw_latents(16)
    before, after = acted(parent, obs, latent), acted(agent, obs, latent)
    assert all(torch.equal(one, other) for one, other in zip(before, after, strict=True))


def test_only_what_is_new_learns(kind: str, tmp_path: Path) -> None:
    learner = runner(kind, tmp_path)
    agent: Any = learner.agent
    named = ("encoder", "label", EYE, "model", "discriminator")
    parts = {name: getattr(agent, name) for name in named if hasattr(agent, name)}
    before = {name: copies(part) for name, part in parts.items()}
    history: list[dict[str, float]] = []
    learner.on_iteration = [history.append]
    learner.run()
    for name in parts.keys() - {"model", "discriminator"}:
        assert equal(copies(parts[name]), before[name]), name
    after = copies(agent.model)
    moved = {name for name, value in after.items() if not torch.equal(value, before["model"][name])}
    assert not [name for name in moved if name.startswith(("policy.base", "state_normalizer.normalizers.0"))]
    learned = ("embed.weight", "adaptors.0.weight", "adaptors.1.weight")
    assert {f"policy.adapters.0.{name}" for name in learned} <= moved
    assert {"state_normalizer.normalizers.1.mean", "critic.critic.0.0.weight", "return_normalizer.mean"} <= moved
    assert not equal(copies(agent.discriminator), before["discriminator"])
    assert history[-1]["ppo/injection"] > 0
    assert history[-1]["ppo/decay"] > 0
    assert ("ppo/diversity" in history[-1]) == (kind != "calm")
    assert not {"discriminator/encoder", "ppo/alignment", "ppo/uniformity"} & history[-1].keys()
    known = {id(parameter) for parameter in agent.ppo.optimizer.state}  # what Adam has moments of
    assert not [name for name, p in agent.model.named_parameters() if id(p) in known and "policy.base" in name]


def test_an_adapted_case_obeys_its_labels() -> None:
    """Labels part the actions as they do in the base, however far the adapter has gone."""
    parent = make_parent("case", SKILLS)
    env, obs = observe()
    agent = make("case", env, torch.Generator(), base_of(parent))
    latent = parent.draw_latents(1)[0]
    asked = [obs | {"skill": torch.full((16,), label)} for label in range(SKILLS)]
    own, begun = ([acted(one, each, latent)[0] for each in asked] for one in (parent, agent))
    assert all(torch.equal(a, b) for a, b in zip(own, begun, strict=True))
    shake(agent, 0.02)
    gone = [acted(agent, each, latent)[0] for each in asked]
    for a, b in ((0, 1), (1, 2), (2, 0)):
        apart, now = own[a] - own[b], gone[a] - gone[b]
        assert apart.abs().max() > 0.05
        assert torch.cosine_similarity(apart.flatten(), now.flatten(), 0) > 0.8
    assert not torch.equal(own[0], gone[0])


@pytest.mark.parametrize("shared", [True, False], ids=["shared_trunk", "own_trunk"])
@pytest.mark.parametrize("name", ["ase", "case"])
def test_the_bases_encoder_says_which_latent_a_motion_was(name: str, shared: bool) -> None:
    """In the units, and on the features, that it was trained with; the new discriminator has others."""
    changes = {"shared_trunk": shared} if name == "ase" else {}
    parent = make_parent(name, SKILLS, **changes)
    parent.discriminator.normalizer.update(3 * torch.randn(5000, 4, generator=torch.Generator().manual_seed(0)) + 1)
    agent = make(name, PointMass(16, skills=SKILLS), torch.Generator().manual_seed(4), base_of(parent), **changes)
    rollout = collected(agent, PointMass(16, skills=SKILLS))
    theirs, ours = parent.rewards(rollout), agent.rewards(rollout)
    assert torch.equal(theirs["skill"], ours["skill"])
    assert not torch.allclose(theirs["style"], ours["style"])


def test_an_adapted_calm_encodes_motions_as_its_base(tmp_path: Path) -> None:
    learner = runner("calm", tmp_path)
    agent: Any = learner.agent
    motions = agent._draw_motions(20).window
    parent = make_parent("calm", SKILLS)
    assert torch.equal(agent.encode(motions), parent.encode(motions))
    learner.run()
    assert torch.equal(agent.encode(motions), parent.encode(motions))
    assert agent.encoder.normalizer.frozen


def test_a_checkpoint_stands_alone(kind: str, tmp_path: Path) -> None:
    """Of it alone come the adaptation, its base and an agent as it was before training."""
    learner = runner(kind, tmp_path)
    parent = base_of(make_parent(kind, SKILLS))
    agent: Any = learner.agent
    learner.run()
    state = checkpoint.load(tmp_path)["agent"]
    within = Base.within(state)
    assert within is not None
    assert equal(dict(within.policy), dict(parent.policy))
    env, obs = observe()
    again, fresh, first = (make(kind, env, torch.Generator().manual_seed(8), base) for base in (within, within, parent))
    again.load_state_dict({**state, "latents": again.state_dict()["latents"], "replay": again.replay.state_dict()})
    latent = agent.draw_latents(1)[0]
    assert torch.equal(acted(again, obs, latent)[0], acted_by(agent, obs, latent))
    assert torch.equal(acted(fresh, obs, latent)[0], acted(first, obs, latent)[0])
    assert not torch.equal(acted(again, obs, latent)[0], acted(first, obs, latent)[0])
    assert Base.within(make_parent(kind, SKILLS).state_dict()) is None


def acted_by(agent: Any, obs: Obs, latent: Tensor) -> Tensor:
    """Likeliest actions of an agent that was made for more worlds."""
    worlds = agent.latents if hasattr(agent, "latents") else agent.motions
    more = {name: value.repeat(2, *[1] * (value.dim() - 1)) for name, value in obs.items()}
    worlds.hold(latent)
    return agent.act(more, deterministic=True).action[:16]


def test_uneven_ground_is_seen_by_policy_and_critic(kind: str, generator: torch.Generator) -> None:
    env, obs = observe(heights=True)
    agent = make_adapted(kind, env, generator)
    assert {"heights", "next_heights"} <= agent.needs
    assert "heights" not in make_adapted(kind, PointMass(3, skills=SKILLS), generator).needs
    shake(agent)
    agent.follow(agent.draw_latents(1)[0])
    other = obs | {"heights": obs["heights"] + 1}
    step = agent.act(obs, deterministic=True)
    assert not torch.allclose(step.action, agent.act(other, deterministic=True).action, atol=1e-3)
    assert not torch.allclose(agent.value(obs, step.extras), agent.value(other, step.extras), atol=1e-4)
    rollout = collected(agent, env)
    before = copies(agent.model)
    agent.update(rollout)
    moved = {name for name, value in agent.model.state_dict().items() if not torch.equal(value, before[name])}
    assert {"policy.adapters.0.control.layers.0.weight", "critic.control.layers.0.weight"} <= moved


def test_the_critic_looks_at_the_states_as_they_are_now(kind: str, generator: torch.Generator) -> None:
    """Through the normaliser that learns on; the frozen one is the policy's alone."""
    env, obs = observe()
    agent = make_adapted(kind, env, generator)
    extras = agent.act(obs).extras
    own, new = agent.model.state_normalizer.normalizers
    before = agent.value(obs, extras)
    own.mean += 1.0
    assert torch.equal(agent.value(obs, extras), before)
    new.mean += 1.0
    assert not torch.allclose(agent.value(obs, extras), before, atol=1e-3)


def test_penalties_by_hand(kind: str, generator: torch.Generator) -> None:
    agent = make_adapted(kind, PointMass(6, skills=SKILLS), generator, injection_penalty=0.5, weight_decay=0.1)
    policy = agent.model.policy
    assert isinstance(policy, AdaptedPolicy)
    adapter = policy.adapters[0]
    assert adapter.embed is not None
    with torch.no_grad():
        adapter.embed.bias[:2] = torch.tensor([3.0, 4.0])
        adapter.adaptors[0].bias[:3] = 2.0  # type: ignore[index]
    batch = Minibatch({"state": torch.zeros(6, 8)}, Part(ALONE, 6))
    agent.model.tell(torch.zeros(6, 4 if kind != "case" else 12), batch)
    penalties = agent.model.penalties(batch)
    assert penalties["injection"].item() == pytest.approx(0.5 * 5)
    assert penalties["decay"].item() == pytest.approx(0.1 * 12)
    assert make_parent(kind).model.penalties(batch) == {}


@pytest.mark.parametrize("name", ["ase", "case"])
@pytest.mark.parametrize("heights", [False, True], ids=["flat", "map"])
def test_diversity_compares_what_two_latents_do(name: str, heights: bool, generator: torch.Generator) -> None:
    """Each with its own injection, on the same ground."""
    env, obs = observe(heights)
    agent = make_adapted(name, env, generator)
    shake(agent)
    model, z = agent.model, agent.draw_latents(16)
    rows = {"state": model.state_normalizer(obs["state"]), "latent": z, "label": obs["skill"]}
    batch = Minibatch({**rows, **({"heights": obs["heights"]} if heights else {})}, Part(ALONE, 16))

    def condition(latent: Tensor) -> Tensor:
        return latent if name == "ase" else agent.condition(latent, obs["skill"])

    mean = model.policy(batch["state"], model.tell(condition(z), batch))
    assert INJECTION in batch
    drawn = generator.get_state()
    found = agent._diversity(batch, mean)["diversity"]
    generator.set_state(drawn)
    other = agent.draw_latents(16)
    other_mean = model.policy(batch["state"], model.told(condition(other), obs))
    by_hand = diversity_loss(mean, other_mean, z, other, torch.full((2,), 0.1), "action")
    torch.testing.assert_close(found, agent.config.diversity_weight * by_hand)
    assert not torch.allclose(mean, other_mean, atol=1e-3)


@pytest.mark.parametrize(
    ("name", "of", "changes", "line"),
    [
        ("ase", "case", {}, "the checkpoint's base policy differs from the config's: 'trunk.0.weight'"),
        ("ase", "calm", {}, "the checkpoint's discriminator of the base has other layers"),
        ("case", "case", {"label_dim": 5}, "the checkpoint's base policy differs from the config's"),
        (
            "ase",
            "ase",
            {"adapter": AdapterConfig(injection=(3,))},
            r"injection=\[3\]: the policy has the latent spaces",
        ),
        ("ase", "ase", {"weight_decay": -1.0}, r"agent\.weight_decay=-1\.0: a penalty is 0 or more"),
    ],
)
def test_a_base_that_does_not_fit_is_refused_in_one_line(
    name: str, of: str, changes: dict, line: str, generator: torch.Generator
) -> None:
    with pytest.raises(AgentError, match=line) as error:
        make(name, PointMass(3, skills=SKILLS), generator, base_of(make_parent(of, SKILLS)), **changes)
    assert "\n" not in str(error.value)


def test_what_is_no_base(kind: str, generator: torch.Generator) -> None:
    agent = make_adapted(kind, PointMass(3, skills=SKILLS), generator)
    with pytest.raises(AgentError, match="no policy that was trained from nothing"):
        base_of(agent)
    other = make_parent(kind, SKILLS)
    base = base_of(other)
    parts = {name: part for name, part in base.parts.items() if name != "encoder"}
    with pytest.raises(AgentError, match="the base has no encoder: it is another agent's"):
        make(kind, PointMass(3, skills=SKILLS), generator, replace(base, parts=parts))
    with pytest.raises(AgentError, match="the base acts with 1 numbers, the environment takes 2"):
        make(kind, PointMass(3, skills=SKILLS), generator, base_of(other).pruned([1]))
    sizes = {len(base.pruned([1]).policy[name]) for name in ("head.weight", "head.bias", "log_std")}
    assert sizes == {1}
    with pytest.raises(AgentError, match="has other layers than the config's"):
        other.load_state_dict(agent.state_dict())
