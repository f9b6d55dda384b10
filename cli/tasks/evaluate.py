"""`murmillo evaluate` of a run that learned a task."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from murmillo.cli.errors import CommandError


@dataclass
class TaskEvaluateConfig:
    """What `murmillo evaluate` takes for such a run; see `murmillo.cli.evaluate.HELP`."""

    run: str
    worlds: int = 256
    seed: int = 12345
    low: str | None = None
    motions: str | None = None


def run(words: list[str]) -> int:
    """Measure, keep and print the figures, and write the report anew."""
    from murmillo.cli import config as configuration
    from murmillo.cli.tasks import report
    from murmillo.cli.tasks.evaluating import evaluate
    from murmillo.cli.tasks.opening import open_run

    settings = configuration.parse(TaskEvaluateConfig, words)

    def measured(folder: Path) -> dict[str, Any]:
        config, below = open_run(folder, settings.low, settings.motions)
        return evaluate(config, below, folder, settings.worlds, settings.seed)

    return answer(settings, measured, report.write)


def answer(settings: Any, measured: Callable[[Path], dict[str, Any]], write: Callable[[Path], Path]) -> int:
    """Print what is measured of the run in `settings.run`, and write its report anew.

    Raises:
        CommandError: the settings' number of worlds or seed cannot be.
    """
    from murmillo.cli import runs, tables
    from murmillo.cli.seeds import check_seed
    from murmillo.cli.tasks import table

    if settings.worlds < 1:
        raise CommandError(f"worlds={settings.worlds}: needs at least 1 episode")
    check_seed("seed", settings.seed)
    folder = Path(settings.run)
    results = measured(folder)
    tables.show(table.columns(results), table.rows(results, spread=False), left=("",))
    print(f"the report: {write(folder)} (and {runs.METRICS})")
    return 0
