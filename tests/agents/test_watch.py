"""Every known failure is said once, when it has lasted; a run as it should be says nothing."""

import dataclasses
import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from murmillo.agents.common.failures import WATCHED, Trend, WatchConfig
from murmillo.agents.common.watch import Watch
from murmillo.cli.config import compose_train
from tests.agents.toy import make_runner, small_ase

BATCH = 8192
Curves = dict[str, Callable[[int], float]]


def healthy() -> Curves:
    """A run of ASE by iteration: its first 138 as a smoke run had them, then as one hopes. Noise is a slow wave."""

    def saturating(begin: float, end: float, iterations: float) -> Callable[[int], float]:
        return lambda i: end + (begin - end) * math.exp(-i / iterations) + 0.01 * (end - begin) * math.sin(0.7 * i)

    rise, late = saturating(12.0, 36.0, 3), saturating(0.0, 200.0, 2000)
    return {
        "agent_accuracy": saturating(0.41, 0.8, 150),
        "demonstration_accuracy": saturating(0.43, 0.96, 60),
        "skill": lambda i: 0.004 * math.sin(2.1 * i) + 0.6 / (1 + math.exp((700 - i) / 100)),
        "value": lambda i: 15.0 * math.exp(-(i - 1) / 0.5) + 0.9 * math.exp(-i / 20) + 0.07 + 0.02 * math.sin(0.3 * i),
        "fall_rate": lambda i: 1.0 if i < 500 else 0.9,
        "length": lambda i: rise(i) + late(i),
    }


def said(watch: Watch, curves: Curves, begin: int, end: int) -> list[tuple[int, str]]:
    """What the watch says in the iterations from `begin` to `end`, inclusive, and when."""
    spoken = []
    for i in range(begin, end + 1):
        scalars = {WATCHED[name]: curve(i) for name, curve in curves.items()}
        spoken += [(i, text) for text in watch.see({"samples": float(BATCH * i), **scalars})]
    return spoken


def stepped(before: float, at: int, after: float) -> Callable[[int], float]:
    return lambda i: before if i < at else after


FAILURES: dict[str, tuple[Curves, int]] = {
    "discriminator": ({"agent_accuracy": lambda i: 0.99, "demonstration_accuracy": lambda i: 0.985}, 50),
    "encoder": ({"skill": lambda i: 0.004 * (-1) ** i}, 500),
    # the slow mean looks back 20 iterations and is above 1 with the second step: 10 - 9.9 x 0.95^2 = 1.07
    "value": ({"value": stepped(0.1, 31, 10.0)}, 32 + 9),
    "falls": ({"fall_rate": lambda i: 1.0, "length": lambda i: 20.0}, 100),
}
"""Curves that replace healthy ones, and the iteration at which the default patience ends."""


@pytest.mark.parametrize("failure", FAILURES)
def test_a_failure_is_said_once_when_it_has_lasted(failure: str) -> None:
    curves, when = FAILURES[failure]
    watch = Watch(WatchConfig(quiet=0))
    ((iteration, text),) = said(watch, {**healthy(), **curves}, 1, 1500)
    assert iteration == when
    assert "\n" not in text
    assert [(notice.failure, notice.samples, notice.over) for notice in watch.notices] == [
        (failure, BATCH * when, None)
    ]


@pytest.mark.parametrize("failure", FAILURES)
def test_what_is_to_be_tried_are_settings(failure: str) -> None:
    """Of every agent that logs what the failure is seen in."""
    curves, when = FAILURES[failure]
    ((_, text),) = said(Watch(WatchConfig(quiet=0)), curves, 1, when)
    names = re.findall(r"\b(?:agent|env|runner|warm_start)\.[a-z_.]*[a-z]", text)
    assert len(names) >= 3
    for agent in ("ase", "case") if failure == "encoder" else ("ase", "case", "calm"):
        settings = dataclasses.asdict(compose_train([f"agent={agent}"]))
        for name in names:
            level = settings
            for part in name.split("."):
                assert part in level, f"{agent} has no {name}"
                level = level[part]


def test_a_trend_by_hand() -> None:
    trend = Trend()
    for value in (4.0, 2.0, 3.0, 5.0, 9.0):
        trend.add(value, memory=2)
    # slow: 4, 3, 3, 4, 6.5; early is the fourth
    assert trend == Trend(count=5, slow=6.5, lowest=3.0, early=4.0)


def test_a_healthy_run_says_nothing() -> None:
    assert said(Watch(WatchConfig(quiet=0)), healthy(), 1, 2400) == []


def test_nothing_is_said_before_the_first_samples() -> None:
    watch = Watch(WatchConfig())
    spoken = said(watch, FAILURES["discriminator"][0], 1, 100)
    assert [iteration for iteration, _ in spoken] == [62]  # 61 x 8,192 is just below 500,000


@pytest.mark.parametrize("after", [0.0, 0.1])
def test_a_skill_reward_that_is_never_negative_has_another_level_of_chance(after: float) -> None:
    """max(mu . z, 0) is 0.05 on average for random directions in 64 dimensions."""
    spoken = said(Watch(WatchConfig(quiet=0)), {"skill": stepped(0.05, 100, 0.05 + after)}, 1, 1000)
    assert len(spoken) == (0 if after else 1)


def test_a_first_value_that_is_low_by_chance_hides_nothing() -> None:
    assert len(said(Watch(WatchConfig(quiet=0)), {"skill": stepped(-0.05, 2, 0.0)}, 1, 500)) == 1


def test_a_failure_is_over_after_as_long_without_it_and_can_come_again() -> None:
    def accuracy(i: int) -> float:
        return 0.5 if 100 < i <= 300 or i % 40 == 0 else 1.0  # a good iteration now and then is noise

    watch = Watch(WatchConfig(quiet=0, memory=1, accuracy_iterations=30))
    curves: Curves = {"agent_accuracy": accuracy, "demonstration_accuracy": accuracy}
    assert [iteration for iteration, _ in said(watch, curves, 1, 400)] == [30, 330 + 20]
    first, second = watch.notices
    assert (first.over, second.over) == (BATCH * 130, None)


def test_a_collapse_after_success_is_seen() -> None:
    curves: Curves = {"fall_rate": lambda i: 1.0, "length": stepped(20.0, 41, 100.0)}
    watch = Watch(WatchConfig(quiet=0))
    assert said(watch, curves, 1, 300) == []
    ((_, text),) = said(watch, {**curves, "length": lambda i: 15.0}, 301, 600)
    assert re.search(r"after \d\d\.\d steps \(20\.0 early on\)", text)


def test_iterations_in_which_no_episode_ended_do_not_count() -> None:
    def curve(value: float) -> Callable[[int], float]:
        return lambda i: value if i % 2 else math.nan

    ((_, text),) = said(
        Watch(WatchConfig(quiet=0)), {"fall_rate": curve(1.0), "length": curve(20.0)}, 1, FAILURES["falls"][1]
    )
    assert "nan" not in text


@pytest.mark.parametrize("failure", FAILURES)
@pytest.mark.parametrize("until", [5, -1, 0, 20])
def test_a_watch_that_is_taken_up_again_goes_on_as_it_was(failure: str, until: int) -> None:
    """Saved early, just before it speaks, just after and later."""
    curves, when = FAILURES[failure]
    at = until if until == 5 else when + until
    whole, first, second = (Watch(WatchConfig(quiet=0)) for _ in range(3))
    straight = said(whole, curves, 1, when + 50)
    halves = said(first, curves, 1, at)
    second.load_state_dict(json.loads(json.dumps(first.state_dict())))
    assert halves + said(second, curves, at + 1, when + 50) == straight
    assert second.state_dict() == whole.state_dict()
    assert len(straight) == 1


def test_the_runner_warns_of_a_hopeless_setting_only(tmp_path: Path) -> None:
    """A policy that stands still against a discriminator without a penalty has lost."""
    config, spoken = small_ase(), {}
    hopeless = {
        "discriminator": dataclasses.replace(config.discriminator, learning_rate=0.01, gradient_penalty=0.0),
        "ppo": dataclasses.replace(config.ppo, policy_learning_rate=0.0),
    }
    for name, agent in (("hopeless", hopeless), ("sound", {})):
        watch = WatchConfig(quiet=0, memory=3, accuracy_iterations=10)
        runner = make_runner(tmp_path / name, samples=22 * 256, agent=agent, watch=watch)
        spoken[name] = []
        runner.on_warning = [spoken[name].append]
        runner.run()
    assert spoken["sound"] == []
    (text,) = spoken["hopeless"]
    assert text.startswith("the discriminator has been right on 100.0% of the agent's motions")
