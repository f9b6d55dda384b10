"""`murmillo evaluate` of a run that learned a task."""

from dataclasses import dataclass
from pathlib import Path

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
    from murmillo.cli import runs, tables
    from murmillo.cli.seeds import check_seed
    from murmillo.cli.tasks import report, table
    from murmillo.cli.tasks.evaluating import evaluate
    from murmillo.cli.tasks.opening import open_run

    settings = configuration.parse(TaskEvaluateConfig, words)
    if settings.worlds < 1:
        raise CommandError(f"worlds={settings.worlds}: needs at least 1 episode")
    check_seed("seed", settings.seed)
    folder = Path(settings.run)
    config, below = open_run(folder, settings.low, settings.motions)
    results = evaluate(config, below, folder, settings.worlds, settings.seed)
    tables.show(table.columns(results), table.rows(results, spread=False), left=("",))
    print(f"the report: {report.write(folder)} (and {runs.METRICS})")
    return 0
