"""`murmillo evaluate` of a run of AdaptNet."""

from dataclasses import dataclass
from pathlib import Path

from murmillo.cli.errors import CommandError


@dataclass
class AdaptNetEvaluateConfig:
    """What `murmillo evaluate` takes for such a run; see `murmillo.cli.evaluate.HELP`."""

    run: str
    worlds: int = 256
    seed: int = 12345
    base: str | None = None
    motions: str | None = None


def run(words: list[str]) -> int:
    """Measure, keep and print the figures, and write the report anew."""
    from murmillo.cli import config as configuration
    from murmillo.cli import runs, tables
    from murmillo.cli.adaptation import report
    from murmillo.cli.adaptation.evaluating import evaluate
    from murmillo.cli.adaptation.world import open_run
    from murmillo.cli.seeds import check_seed
    from murmillo.cli.tasks import table

    settings = configuration.parse(AdaptNetEvaluateConfig, words)
    if settings.worlds < 1:
        raise CommandError(f"worlds={settings.worlds}: needs at least 1 episode")
    check_seed("seed", settings.seed)
    folder = Path(settings.run)
    config, base = open_run(folder, settings.base, settings.motions)
    results = evaluate(config, base, folder, settings.worlds, settings.seed)
    tables.show(table.columns(results), table.rows(results, spread=False), left=("",))
    print(f"the report: {report.write(folder)} (and {runs.METRICS})")
    return 0
