from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

from murmillo.agents.common import checkpoint
from murmillo.agents.common.episodes import EpisodeStatistics
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.logger import Logger
from murmillo.agents.common.rollout import taken
from tests.agents.toy import PointMass, equal, make_runner, small_ase

ITERATION = 32 * 8


def test_n_and_n_more_are_2n_bit_for_bit(tmp_path: Path) -> None:
    straight: list[dict[str, float]] = []
    price: dict[str, Any] = {"termination_reward": -2.0, "termination_fades": True}
    whole = make_runner(tmp_path / "whole", samples=6 * ITERATION, **price)
    whole.env.bound = 0.6  # type: ignore[attr-defined]
    whole.on_iteration = [straight.append]
    whole.run()

    halves: list[dict[str, float]] = []
    first = make_runner(tmp_path / "half", samples=3 * ITERATION, **price)
    first.env.bound = 0.6  # type: ignore[attr-defined]
    first.on_iteration = [halves.append]
    first.run()
    second = make_runner(tmp_path / "half", samples=6 * ITERATION, seed=77, **price)
    second.env.bound = 0.6  # type: ignore[attr-defined]
    second.on_iteration = [halves.append]
    second.load(tmp_path / "half")
    second.run()

    assert 0 < whole.fallen < 1
    for one, other in zip(straight, halves, strict=True):
        assert {**one, "samples_per_second": 0.0} == pytest.approx(
            {**other, "samples_per_second": 0.0}, rel=0, abs=0, nan_ok=True
        )
    assert equal(checkpoint.load(tmp_path / "whole"), checkpoint.load(tmp_path / "half"))


def test_another_seed_is_another_run(tmp_path: Path) -> None:
    for seed in (0, 1):
        make_runner(tmp_path / str(seed), samples=ITERATION, seed=seed).run()
    assert not equal(checkpoint.load(tmp_path / "0"), checkpoint.load(tmp_path / "1"))


def test_the_successor_in_the_rollout_is_the_true_one(tmp_path: Path) -> None:
    runner = make_runner(tmp_path, horizon=40, agent={"latent_steps": (150, 150)})
    rollout = runner._collect()
    done = rollout["terminated"] | rollout["truncated"]
    assert done.any()
    # no step moves further than the speed allows, also where an episode ended; the window ends with the successor
    assert (rollout["next_state"] - rollout["state"])[..., :2].abs().max() <= 0.1 + 1e-6
    assert torch.equal(rollout["next_window"][..., -1, :], rollout["next_state"])
    # and only a new episode brings a new latent before its time
    assert torch.equal((rollout["latent"][:-1] == rollout["latent"][1:]).all(-1), ~done[:-1])
    follows = rollout["next_state"][:-1] == rollout["state"][1:]
    assert torch.equal(follows.all(-1), ~done[:-1])


def test_stop_ends_after_the_iteration_and_saves(tmp_path: Path) -> None:
    runner = make_runner(tmp_path / "c", samples=10**9)
    runner.on_iteration = [lambda stats: runner.stop() if stats["iteration"] == 2 else None]
    runner.run()
    assert checkpoint.load(tmp_path / "c")["iteration"] == 2


def test_minutes_end_a_run(tmp_path: Path) -> None:
    runner = make_runner(tmp_path / "c", samples=10**9, max_minutes=0.01)
    runner.run()
    assert runner.iteration >= 1


def test_named_rewards_are_weighted_and_logged(tmp_path: Path) -> None:
    runner = make_runner(tmp_path, reward_weights={"task": 2.0, "style": 1.0, "skill": 0.5})
    rollout = runner._collect()
    means = runner._reward(rollout)
    total = 2 * means["reward/task"] + means["reward/style"] + 0.5 * means["reward/skill"]
    assert means["reward/total"] == pytest.approx(total, rel=1e-5)


def test_the_price_of_a_termination_fades_with_their_share_if_that_is_asked(tmp_path: Path) -> None:
    paid = {}
    for fades in (False, True):
        runner = make_runner(tmp_path / str(fades), termination_reward=-8.0, termination_fades=fades, horizon=40)
        runner.env.bound = 0.52  # type: ignore[attr-defined]
        rollout = runner._collect()
        runner._log({}, 1.0)
        rate = rollout["terminated"].sum() / (rollout["terminated"] | rollout["truncated"]).sum()
        assert 0 < rate < 1
        assert runner.fallen == pytest.approx(1 - 0.02 * (1 - rate.item()), rel=1e-5)
        runner.fallen = 0.25  # some hundred iterations later
        runner._reward(rollout)
        paid[fades] = set(rollout["reward"][rollout["terminated"]].tolist())
    assert paid == {False: {-8.0}, True: {-2.0}}


def test_where_no_episode_ended_the_share_stays(tmp_path: Path) -> None:
    runner = make_runner(tmp_path)
    runner.fallen = 0.5
    runner._log({}, 1.0)
    assert runner.fallen == 0.5


def test_side_rewards_of_the_environment_count_where_they_are_weighted(tmp_path: Path) -> None:
    for weights in ({"style": 1.0, "skill": 0.5}, {"style": 1.0, "skill": 0.5, "residual": 0.1}):
        runner = make_runner(tmp_path, reward_weights=weights)
        step = runner.env.step

        def helped(actions: np.ndarray, step: Any = step) -> Any:
            *results, infos = step(actions)
            return *results, {**infos, "side_rewards": {"residual": np.full(32, 0.7, np.float32)}}

        runner.env.step = helped  # type: ignore[method-assign]
        means = runner._reward(runner._collect())
        assert means["reward/residual"] == pytest.approx(0.7)
        total = means["reward/style"] + 0.5 * means["reward/skill"] + weights.get("residual", 0.0) * 0.7
        assert means["reward/total"] == pytest.approx(total, rel=1e-5)


@pytest.mark.parametrize("weights", [{"style": 1.0}, {"style": 1.0, "skill": 0.5, "styl": 1.0}])
def test_weights_and_terms_must_match(tmp_path: Path, weights: dict[str, float]) -> None:
    with pytest.raises(AgentError, match="the terms are skill, style, task"):
        make_runner(tmp_path, reward_weights=weights).run()


def test_a_weight_of_zero_may_name_what_there_is_not(tmp_path: Path) -> None:
    make_runner(tmp_path, samples=1, reward_weights={"style": 1.0, "skill": 0.5, "residual": 0.0}).run()


def test_nan_stops_with_one_line_and_spoils_no_checkpoint(tmp_path: Path) -> None:
    runner = make_runner(tmp_path / "c", samples=ITERATION)
    runner.run()
    runner.config.samples = 2 * ITERATION
    with torch.no_grad():
        next(iter(runner.agent.model.policy.parameters())).fill_(torch.nan)  # type: ignore[attr-defined]
    with pytest.raises(AgentError, match=r"iteration 2: .* is nan") as error:
        runner.run()
    assert "\n" not in str(error.value)
    assert checkpoint.load(tmp_path / "c")["iteration"] == 1


def test_a_checkpoint_of_something_else_is_refused(tmp_path: Path) -> None:
    runner = make_runner(tmp_path / "c", samples=1)
    runner.meta = {"character": "toy"}
    runner.run()
    other = make_runner(tmp_path / "c", samples=1)
    other.meta = {"character": "humanoid"}
    with pytest.raises(AgentError, match="character is 'toy' there, 'humanoid' here"):
        other.load(tmp_path / "c")


@pytest.mark.parametrize("part", ["watch", "generator", "meta"])
def test_a_checkpoint_that_lacks_a_part_is_refused_in_one_line(tmp_path: Path, part: str) -> None:
    make_runner(tmp_path / "c", samples=1).run()
    state = checkpoint.load(tmp_path / "c")
    checkpoint.save(tmp_path / "c", {name: value for name, value in state.items() if name != part})
    with pytest.raises(AgentError, match=rf"c has no {part}: .* begin a new one") as error:
        make_runner(tmp_path / "c").load(tmp_path / "c")
    assert "\n" not in str(error.value)


def test_another_autoreset_mode_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runner = make_runner(tmp_path)
    env = PointMass(2)
    env.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}
    with pytest.raises(AgentError, match="SAME_STEP"):
        type(runner)(env, runner.agent, runner.config, runner.generator, tmp_path)


def test_one_world_and_odd_sizes(tmp_path: Path) -> None:
    make_runner(tmp_path / "c", num_envs=1, horizon=131, samples=2 * 131).run()
    assert checkpoint.load(tmp_path / "c")["samples"] == 262


def test_the_log_of_a_resumed_run_has_every_iteration_once(tmp_path: Path) -> None:
    for samples, seed in ((2, 0), (4, 1)):
        runner = make_runner(tmp_path / "c", samples=samples * ITERATION, seed=seed)
        runner.logger = Logger(tmp_path)
        if seed:
            runner.load(tmp_path / "c")
        runner.run()
        runner.logger.close()
    lines = (tmp_path / "scalars.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["samples", *(str(n * ITERATION) for n in (1, 2, 3, 4))]


def test_episode_statistics_by_hand() -> None:
    episodes = EpisodeStatistics(3)
    yes, no = True, False
    for terminated, truncated in (
        ([no, no, no], [no, no, no]),
        ([yes, no, no], [no, no, no]),
        ([yes, no, no], [no, yes, no]),
    ):
        end, cut = torch.tensor(terminated), torch.tensor(truncated)
        episodes.step(end, end | cut)
    assert episodes.summary() == {"episode/length": 2.0, "episode/fall_rate": pytest.approx(2 / 3)}  # 2, 1 and 3 steps
    assert episodes.length.tolist() == [0, 0, 3]
    assert episodes.summary()["episode/length"] != episodes.summary()["episode/length"]  # NaN: none ended


def test_nothing_is_learned_from_steps_of_diverged_worlds(tmp_path: Path) -> None:
    runner = make_runner(tmp_path)
    whole = runner._collect()
    runner._reward(whole)
    healed = torch.zeros(whole.shape, dtype=torch.bool)
    healed[3, 1] = healed[7, 0] = True
    whole["healed"] = healed
    whole["terminated"] = whole["terminated"] | healed
    runner._advantage(whole)
    value = runner.agent.value({"state": whole["state"]}, {"latent": whole["latent"]})
    torch.testing.assert_close(whole["return"][healed], value[healed])  # what comes before ends in the expected return
    kept = ~healed.flatten()
    assert torch.equal(whole.flat("action"), whole["action"].flatten(0, 1)[kept])
    rows = torch.cat([rows for rows, _ in whole.minibatches(7, torch.Generator().manual_seed(0))])
    assert rows.sort().values.tolist() == list(range(whole.samples - 2))
    runner.agent.update(whole)


def test_a_policy_learns_nothing_from_steps_without_noise_and_its_critic_does(tmp_path: Path) -> None:
    ppo = replace(small_ase().ppo, quiet_share=0.5)
    runner = make_runner(tmp_path, agent={"ppo": ppo})
    rollout = runner._collect()
    runner._reward(rollout)
    runner._advantage(rollout)
    quiet = rollout["quiet"]
    assert quiet.any()
    assert not quiet.all()
    assert (rollout["advantage"][quiet] == 0).all()
    assert (rollout["advantage"][~quiet] != 0).all()
    assert (rollout["return"][quiet] != 0).all()
    # what is quiet is the mean itself, which no noise comes to
    likeliest = rollout["log_prob"][quiet]
    torch.testing.assert_close(likeliest, likeliest.max().expand_as(likeliest))
    assert (rollout["log_prob"][~quiet] < likeliest.max()).all()


def test_without_quiet_steps_all_are_learned_from(tmp_path: Path) -> None:
    assert "quiet" not in make_runner(tmp_path)._collect()


def test_tensors_stay_tensors_where_the_environment_takes_them() -> None:
    action, env = torch.zeros(8, 2), PointMass(8)
    assert isinstance(taken(env, action), np.ndarray)
    env.tensors = True  # type: ignore[attr-defined]
    assert taken(env, action) is action
