"""Iterations of training of every agent in turns, by their parts, at every budget."""

from typing import Any

import pytest

from benchmarks.conftest import Effort
from benchmarks.record import Figure, Record
from murmillo.cli.benching.learning import ITERATION, ROLLOUT, UPDATE, Learning, compose, shrunk
from murmillo.cli.benching.turns import rate_of, ratio_of

AGENTS = ("ase", "calm", "case", "adaptnet")
"""AdaptNet by its base, which learns `Navigate`."""
EIGHTH = 8


@pytest.mark.gate
@pytest.mark.parametrize("budget", ["smoke", "laptop"])
def test_iteration(benchmark: Any, effort: Effort, record: Record, budget: str) -> None:
    """The budgets of a laptop at their full size."""
    contestants = make(budget, effort)
    rounds = effort.run(benchmark, [*contestants.values()], rounds=4)
    keep(record, contestants, rounds, budget)
    for agent in AGENTS:
        of_ase = ratio_of(rounds, f"{ITERATION}, {agent}", f"{ITERATION}, ase")
        of_rollout = ratio_of(rounds, f"{ITERATION}, {agent}", f"{ROLLOUT}, {agent}")
        if agent != "ase":
            record.ratios[f"{ITERATION}, {budget}, {agent} / ase"] = of_ase
        record.ratios[f"{budget}, {agent}: {ITERATION} / {ROLLOUT}"] = of_rollout


def test_iteration_of_the_papers(benchmark: Any, effort: Effort, record: Record) -> None:
    """The papers' networks on an eighth of their worlds and minibatches: 16,384 samples for 131,072, AdaptNet's 512."""
    contestants = make("paper", effort)
    keep(record, contestants, effort.run(benchmark, [*contestants.values()], rounds=1, warm_up=0), "paper")


def make(budget: str, effort: Effort) -> dict[str, Learning]:
    """A contestant of each agent, its rollout warm."""
    made = {}
    for agent in AGENTS:
        words = [f"agent={agent}", f"budget={budget}"]
        fraction = (EIGHTH if budget == "paper" else 1) * (8 if effort.quick else 1)
        made[agent] = Learning(compose(words + shrunk(compose(words), fraction)), f", {agent}")
        made[agent].warm_up()
    return made


def keep(record: Record, contestants: dict[str, Learning], rounds: Any, budget: str) -> None:
    """A figure for each agent and part."""
    for agent, contestant in contestants.items():
        note = f"{contestant.env.num_envs} worlds, {contestant.samples:,} samples an iteration"
        for part in (ROLLOUT, UPDATE, ITERATION):
            rate = rate_of(rounds, f"{part}, {agent}")
            record.figures.append(Figure(f"{part}, {agent}, {budget}", rate, "samples/s", note))
        contestant.close()
