import math
from pathlib import Path

import pytest
import torch

from murmillo.agents.adaptnet.networks import ProgressivePolicy
from murmillo.agents.common import checkpoint
from murmillo.agents.common.adapter import AdaptedPolicy, AdapterConfig
from murmillo.agents.common.advantages import gae, normalise_advantage, weigh_advantages
from murmillo.agents.common.base import Base
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.ppo import Minibatch
from murmillo.agents.common.ranks import ALONE, Part
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.runner import Runner
from tests.agents.toy import equal
from tests.agents.toy_adaptnet import Wanderer, make_adaptnet, make_base, toy_runner


def train(runner: Runner) -> list[dict[str, float]]:
    history: list[dict[str, float]] = []
    runner.on_iteration = [history.append]
    runner.run()
    return history


def mean(history: list[dict[str, float]], name: str) -> float:
    return sum(stats[name] for stats in history) / len(history)


def step(runner: Runner) -> Rollout:
    """A rollout that is ready for the update."""
    rollout = runner._collect()
    runner._reward(rollout)
    runner._advantage(rollout)
    return rollout


def test_it_learns_the_goal_and_adapts_to_other_actions(tmp_path: Path) -> None:
    base_run = toy_runner(tmp_path / "base", Wanderer(64), 20)
    history = train(base_run)
    assert mean(history[:3], "reward/task") < 0.1
    assert mean(history[-3:], "reward/task") > 0.25
    base = Base.load(tmp_path / "base")
    assert base.digest == Base.of(base_run.agent.state_dict()["ppo"]["model"]).digest
    history = train(toy_runner(tmp_path / "adapted", Wanderer(64, turned=1.2), 14, base))
    # it begins with what the base can still do, which is more than nothing
    assert 0.05 < history[0]["reward/task"] < 0.15
    assert mean(history[-3:], "reward/task") > 0.18


def test_objectives_are_normalised_and_weighed_apart(generator: torch.Generator) -> None:
    advantage = torch.randn(5, 7, 2, generator=generator) * torch.tensor([1.0, 1000.0])
    task, imitation = (normalise_advantage(one) for one in advantage.unbind(-1))
    torch.testing.assert_close(weigh_advantages(advantage, (0.25, 0.75)), 0.25 * task + 0.75 * imitation)
    reward, value, next_value = torch.randn(3, 5, 7, 2, generator=generator)
    terminated = torch.rand(5, 7, generator=generator) < 0.2
    done = terminated | (torch.rand(5, 7, generator=generator) < 0.2)
    together = gae(reward, value, next_value, terminated, done, 0.9, 0.8)
    for k in range(2):
        alone = gae(reward[..., k], value[..., k], next_value[..., k], terminated, done, 0.9, 0.8)
        assert torch.equal(together[..., k], alone)


def test_a_termination_costs_in_every_objective(tmp_path: Path) -> None:
    runner = toy_runner(tmp_path, Wanderer(32, bound=0.45), 1)
    rollout = step(runner)
    reward, terminated = rollout["reward"], rollout["terminated"]
    assert terminated.any()
    assert (reward[terminated] == -5).all()
    assert torch.equal(reward[~terminated][:, 0], rollout["task"][~terminated])
    # without a future: the advantage of the last step of all is what was not foreseen of the -5
    last = terminated[-1]
    observed = runner.agent.value({name: rollout[name][-1] for name in ("state", "length", "goal")}, {})
    torch.testing.assert_close(
        (rollout["return"][-1] - observed)[last], (reward[-1] - observed)[last], atol=1e-4, rtol=1e-4
    )


def test_a_weight_for_what_has_no_critic_is_refused(tmp_path: Path) -> None:
    runner = toy_runner(tmp_path, Wanderer(32), 1)
    rollout = runner._collect()
    assert "reward/speed" in runner._reward(rollout)
    runner.config.reward_weights["speed"] = 0.1
    with pytest.raises(AgentError, match=r"reward_weights\.speed=0\.1: the agent has critics for task, imitation only"):
        runner._reward(rollout)


def test_only_valid_frames_are_normalised_by(tmp_path: Path) -> None:
    runner = toy_runner(tmp_path, Wanderer(32), 1)
    rollout = step(runner)
    runner.agent.update(rollout)
    normalizer = runner.agent.model.state_normalizer  # type: ignore[attr-defined]
    assert rollout["length"].unique().tolist() == [1, 2, 3, 4]
    assert normalizer.count == rollout["length"].sum()
    valid = torch.cat([s[:n] for s, n in zip(rollout.flat("state"), rollout.flat("length"), strict=True)])
    torch.testing.assert_close(normalizer.mean, valid.double().mean(0))


def test_the_critic_learns_returns_in_units_that_know_them(tmp_path: Path) -> None:
    runner = toy_runner(tmp_path, Wanderer(32), 1)
    targets = runner.agent.model.targets(step(runner))  # type: ignore[attr-defined]
    torch.testing.assert_close(targets.mean(0), torch.zeros(2), atol=1e-4, rtol=0)
    torch.testing.assert_close(targets.std(0, correction=0), torch.ones(2), atol=1e-2, rtol=0)


def test_only_what_is_new_learns(tmp_path: Path) -> None:
    base = make_base()
    runner = toy_runner(tmp_path, Wanderer(32), 1, base)
    agent = runner.agent
    before = {name: value.clone() for name, value in agent.model.state_dict().items()}  # type: ignore[attr-defined]
    stats = agent.update(step(runner))
    after = agent.model.state_dict()  # type: ignore[attr-defined]
    moved = {name for name, value in after.items() if not torch.equal(value, before[name])}
    assert not [name for name in moved if ".base." in name or "normalizers.0" in name]
    parts = ("encoder", "embed", "adaptors.0", "adaptors.1")
    assert all(any(f"policy.adapters.0.{part}" in name for name in moved) for part in parts)
    assert {"state_normalizer.normalizers.1.mean", "critic.head.weight"} <= moved
    # the copy counts from one, so that it soon tells of the new states
    assert after["state_normalizer.normalizers.1.count"] == 1 + runner._rollout["length"].sum()
    assert stats["ppo/injection"] > 0
    assert stats["ppo/decay"] > 0


def test_penalties_by_hand(generator: torch.Generator) -> None:
    agent = make_adaptnet(Wanderer(3), generator, make_base(), injection_penalty=0.5, weight_decay=0.1)
    policy = agent.model.policy
    assert isinstance(policy, AdaptedPolicy)
    adapter = policy.adapters[0]
    assert adapter.embed is not None
    with torch.no_grad():
        adapter.embed.bias[:2] = torch.tensor([3.0, 4.0])
        adapter.adaptors[0].bias[:3] = 2.0  # type: ignore[index]
    rows = {"state": torch.zeros(6, 4, 8), "length": torch.ones(6).long(), "goal": torch.zeros(6, 2)}
    batch = Minibatch(rows, Part(ALONE, 6))
    agent._tell(batch)
    penalties = agent._regularise(batch, torch.zeros(6, 4))
    assert penalties["injection"].item() == pytest.approx(0.5 * 5)
    assert penalties["decay"].item() == pytest.approx(0.1 * 12)


@pytest.mark.parametrize("method", ["finetune", "progressive"])
def test_the_baselines_learn_from_a_base(method: str, tmp_path: Path) -> None:
    base = make_base()
    env = Wanderer(32, heights=method == "progressive")
    runner = toy_runner(tmp_path, env, 2, base, method=method)
    agent = runner.agent
    policy = agent.model.policy  # type: ignore[attr-defined]
    if method == "finetune":
        assert equal(dict(policy.state_dict()), dict(base.policy))
    else:
        assert isinstance(policy, ProgressivePolicy)
    history = train(runner)
    assert ("ppo/decay" in history[0]) == (method == "finetune")
    frozen = policy.base if method == "progressive" else None
    assert (frozen is not None and equal(dict(frozen.state_dict()), dict(base.policy))) == (method == "progressive")
    with pytest.raises(AgentError, match="a policy without adapters cannot be blended"):
        agent.blend(0.5)  # type: ignore[attr-defined]


def test_a_progressive_policy_sees_what_its_base_does(generator: torch.Generator) -> None:
    agent = make_adaptnet(Wanderer(5), generator, make_base(), method="progressive")
    policy = agent.model.policy
    assert isinstance(policy, ProgressivePolicy)
    views = torch.randn(5, 4, 8, generator=generator)
    told = {"length": torch.full((5,), 4), "goal": torch.zeros(5, 2)}
    before = policy(views, told)
    with torch.no_grad():
        for parameter in policy.base.encoder.parameters():
            parameter += 0.5
    assert not torch.allclose(policy(views, told), before, atol=1e-4)


def test_an_adaptation_is_resumed_bit_for_bit(tmp_path: Path) -> None:
    base = make_base()

    def runner(name: str, iterations: int, seed: int = 0) -> Runner:
        return toy_runner(tmp_path / name, Wanderer(32), iterations, base, seed, adapter=AdapterConfig(rank=3))

    runner("whole", 4).run()
    runner("half", 2).run()
    second = runner("half", 4, seed=77)
    second.load(tmp_path / "half")
    second.run()
    assert equal(checkpoint.load(tmp_path / "whole"), checkpoint.load(tmp_path / "half"))


def test_what_is_blended_of_two_or_merged_learns_no_more(tmp_path: Path) -> None:
    base = make_base()
    runner = toy_runner(tmp_path, Wanderer(32), 1, base)
    rollout = step(runner)
    agent = runner.agent
    agent.join(make_adaptnet(Wanderer(32), torch.Generator(), base))  # type: ignore[attr-defined]
    with pytest.raises(AgentError, match="is for playing and learns no more"):
        agent.update(rollout)


def test_an_adapted_run_is_no_base(tmp_path: Path) -> None:
    toy_runner(tmp_path, Wanderer(32), 0, make_base()).save()
    with pytest.raises(AgentError, match="no policy that was trained from nothing"):
        Base.load(tmp_path)


def test_what_does_not_fit_is_refused_in_one_line(generator: torch.Generator) -> None:
    cases = [
        (r"agent\.window=4: the environment's windows are \[3, 2\]", {"window": 4}, Wanderer(3), None),
        (r"agent\.method=magic is not one of adaptnet, finetune, progressive", {"method": "magic"}, Wanderer(3), None),
        (r"agent\.weight_decay=-1: a penalty is 0 or more", {"weight_decay": -1}, Wanderer(3), None),
        (r"agent\.injection_penalty=nan: a penalty is 0 or more", {"injection_penalty": math.nan}, Wanderer(3), None),
        (r"agent\.popart=0: needs a share above 0", {"popart": 0}, Wanderer(3), None),
        ("the base acts by a map of heights, the environment shows none", {}, Wanderer(3), make_base(heights=True)),
        ("the checkpoint's base policy differs from the config's", {"recurrent": 8}, Wanderer(3), make_base()),
    ]
    for line, changes, env, base in cases:
        with pytest.raises(AgentError, match=line) as error:
            make_adaptnet(env, generator, base, **changes)
        assert "\n" not in str(error.value)
