"""`murmillo evaluate`: measure the policy of a run against itself before it was trained."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from murmillo.cli.errors import CommandError

if TYPE_CHECKING:
    from murmillo.cli.config import TrainConfig

HELP = """\
murmillo evaluate: measure a trained agent

  murmillo evaluate run=runs/<name>                  64 episodes; writes evaluation.json into the run's folder

  run       needed           folder of the run
  worlds    64               episodes, one in each world, started in a clip and played with the policy's mean action
  seed      12345            of the starts
  motions   the run's own    a folder or file, where the clips have moved
"""

AGES = {"untrained": "before training", "warm_started": "after the warm start", "trained": "after training"}


@dataclass
class EvaluateConfig:
    """What `murmillo evaluate` takes; see `HELP`."""

    run: str
    worlds: int = 64
    seed: int = 12345
    motions: str | None = None


def run(words: list[str]) -> int:
    """Measure, print a table and write `evaluation.json`."""
    from murmillo.cli import config as configuration
    from murmillo.cli import runs
    from murmillo.cli.seeds import check_seed

    settings = configuration.parse(EvaluateConfig, words)
    if settings.worlds < 1:
        raise CommandError(f"worlds={settings.worlds}: needs at least 1")
    check_seed("seed", settings.seed)
    folder = runs.existing(settings.run, "run")
    config = configuration.load(folder)
    config.env.motions = settings.motions or config.env.motions
    ages = measure_ages(config, folder, settings.worlds, settings.seed)
    runs.write_json(folder / runs.EVALUATION, {"seed": settings.seed, **ages})
    _print(ages)
    print(f"written: {folder / runs.EVALUATION}")
    return 0


def measure_ages(config: "TrainConfig", folder: Path, worlds: int, seed: int = 12345) -> dict[str, dict[str, Any]]:
    """Measures of the run's policy before training, after the warm start (where there was one) and after training.

    The trained discriminator judges all three.

    Raises:
        AgentError: there is no checkpoint, or it does not fit.
    """
    import dataclasses

    from murmillo.cli import runs
    from murmillo.cli.agents import load_player, make_agent
    from murmillo.cli.encodings import concentration
    from murmillo.cli.rollouts import measure
    from murmillo.envs import HumanoidVectorEnv

    # only the first episodes count, which start in a clip: what comes after them need not be costly
    starts = dataclasses.replace(config.env.starts, fallen=0.0)
    env = HumanoidVectorEnv(worlds, dataclasses.replace(config.env, autoreset="same_step", starts=starts))
    try:
        made_of = (config.choices["agent"], config.agent, env, config.seed)
        judge = load_player(*made_of, folder / runs.LAST)
        players = {"untrained": make_agent(*made_of)[0]}
        if (folder / runs.WARM_STARTED).exists():
            players["warm_started"] = load_player(*made_of, folder / runs.WARM_STARTED)
        players["trained"] = load_player(*made_of, folder / runs.LAST)
        return {
            age: measure(env, player, judge, seed).as_dict() | {"concentration": concentration(env, player)}
            for age, player in players.items()
        }
    finally:
        env.close()


def _print(ages: dict[str, dict[str, Any]]) -> None:
    """A row for each age; a column that no age has a figure for is left out."""
    from murmillo.cli import tables

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
