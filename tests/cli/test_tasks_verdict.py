"""The sentence that says whether a task is learned, and why it is not."""

from typing import Any

import pytest

from murmillo.cli.tasks.verdict import verdict


def results(**figures: dict[str, float]) -> dict[str, Any]:
    """`metrics.json` of figures by name and player."""
    return {
        "metrics": {
            "task": {
                "figures": {
                    name: {"values": {player: {"value": value} for player, value in by_player.items()}}
                    for name, by_player in figures.items()
                }
            }
        }
    }


@pytest.mark.parametrize(
    ("trained", "random", "early", "parts"),
    [
        (0.75, 0.5, 1.0, ["**The task is learned**: the return is +0.250 of its range beside that of random latents."]),
        (0.69, 0.5, 0.4, ["not learned yet", "+0.190", "where 0.2 would count. Train it on."]),
        (
            0.1,
            0.12,
            0.9,
            ["not learned yet", "-0.020", "90% of the episodes", "60 of 300", "0.20 of the range", "below"],
        ),
    ],
)
def test_over_an_agent(trained: float, random: float, early: float, parts: list[str]) -> None:
    said = verdict(
        results(
            normalised_return={"untrained": 0.0, "random": random, "trained": trained},
            early_rate={"random": 0.0, "trained": early},
            length={"random": 300.0, "trained": 60.0},
        ),
        300,
    )
    assert [part for part in parts if part not in said] == []


def test_scratch_is_beside_what_it_was() -> None:
    said = verdict(
        results(
            normalised_return={"untrained": 0.1, "trained": 0.2}, early_rate={"trained": 1.0}, length={"trained": 30.0}
        ),
        300,
    )
    assert "+0.100 of its range beside what it was before training" in said
    assert said.endswith("0.10 of the range within reach: train it on.")


def test_without_returns_nothing_is_said() -> None:
    assert verdict(results(length={"trained": 30.0}), 300) == ""
