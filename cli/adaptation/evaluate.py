"""`murmillo evaluate` of a run of AdaptNet."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass
class AdaptNetEvaluateConfig:
    """What `murmillo evaluate` takes for such a run; see `murmillo.cli.evaluate.HELP`."""

    run: str
    worlds: int = 256
    seed: int = 12345
    base: str | None = None
    motions: str | None = None
    alpha: float | None = None
    other: str | None = None


def run(words: list[str]) -> int:
    """Measure, keep and print the figures, and write the report anew."""
    from murmillo.cli import config as configuration
    from murmillo.cli import runs
    from murmillo.cli.adaptation import report
    from murmillo.cli.adaptation.evaluating import evaluate
    from murmillo.cli.adaptation.world import open_run
    from murmillo.cli.blending import Blend, renamed
    from murmillo.cli.tasks import table
    from murmillo.cli.tasks.evaluate import answer

    settings = configuration.parse(AdaptNetEvaluateConfig, renamed(words))
    blend = Blend(settings.alpha, settings.other)

    def measured(folder: Path) -> dict[str, Any]:
        config, base = open_run(folder, settings.base, settings.motions)
        return evaluate(config, base, folder, settings.worlds, settings.seed, blend)

    def write(folder: Path) -> Path:
        if not blend:
            return report.write(folder)
        to = blend.place(folder)
        results = runs.read_json(to / runs.METRICS)
        text = f"# {folder.name}, {blend}\n\n{table.markdown(results)}\n\n{table.meanings(results)}\n"
        runs.write_text(to / runs.EVALUATED, text)
        return to / runs.EVALUATED

    return answer(settings, measured, write)
