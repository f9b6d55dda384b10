"""The policy of a run at three ages: before training, after the warm start, after training."""

import dataclasses
from pathlib import Path
from typing import Any

from murmillo.cli import runs, tables
from murmillo.cli.agents import load_player, load_untrained
from murmillo.cli.blending import NOTHING, Blend, load_blended
from murmillo.cli.config import TrainConfig
from murmillo.cli.devices import for_playing
from murmillo.cli.encodings import concentration
from murmillo.cli.rollouts import AGES, measure
from murmillo.envs import HumanoidVectorEnv


def measure_ages(
    config: TrainConfig, folder: Path, worlds: int, seed: int = 12345, blend: Blend = NOTHING
) -> dict[str, dict[str, Any]]:
    """Measures of the run's policy before training, after the warm start (where there was one) and after training.

    The trained discriminator judges all three. After training the adapters act as was told.

    Raises:
        AgentError: there is no checkpoint, or it does not fit.
    """
    # only the first episodes count, which start in a clip: what comes after them need not be costly
    starts = dataclasses.replace(config.env.starts, fallen=0.0)
    env = HumanoidVectorEnv(worlds, dataclasses.replace(for_playing(config.env), autoreset="same_step", starts=starts))
    try:
        made_of = (config.choices["agent"], config.agent, env, config.seed)
        judge = load_player(*made_of, folder / runs.LAST)
        players = {"untrained": load_untrained(*made_of, folder / runs.LAST)}
        if (folder / runs.WARM_STARTED).exists():
            players["warm_started"] = load_player(*made_of, folder / runs.WARM_STARTED)
        players["trained"] = load_blended(config, env, folder / runs.LAST, blend)
        return {
            age: measure(env, player, judge, seed).as_dict() | {"concentration": concentration(env, player)}
            for age, player in players.items()
        }
    finally:
        env.close()


def show_ages(ages: dict[str, dict[str, Any]]) -> None:
    """Print a row for each age; a column that no age has a figure for is left out."""
    columns = {
        "policy": [AGES[age] for age in ages],
        "episode length [steps]": [f"{m['length']:.1f}" for m in ages.values()],
        "fall rate": [f"{m['fall_rate']:.2f}" for m in ages.values()],
        "style score": [f"{m['score']:.3f}" for m in ages.values()],
        "commanded skill's head": [_figure(m["heads"].get("right")) for m in ages.values()],
        "other heads": [_figure(m["heads"].get("other")) for m in ages.values()],
        "Fisher concentration": [_figure(m["concentration"]) for m in ages.values()],
        "episodes": [f"{m['episodes']}" for m in ages.values()],
        "steps": [f"{m['steps']}" for m in ages.values()],
    }
    columns = {title: cells for title, cells in columns.items() if any(cells)}
    tables.show(tuple(columns), list(zip(*columns.values(), strict=True)), left=("policy",))


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"
