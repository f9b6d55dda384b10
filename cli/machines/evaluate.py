"""`murmillo evaluate machine=…`: how often a machine does its task, how fast, and what it did on the way."""

import csv
import io
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from murmillo.agents.calm.machine.execution import Change
from murmillo.cli import runs, tables
from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation.identity import checkpoint_digest
from murmillo.cli.machines.files import Chosen, choose
from murmillo.cli.machines.measuring import Attempts, attempt
from murmillo.cli.machines.published import published_rate
from murmillo.cli.machines.scene import MachineScene, MachineSettings
from murmillo.cli.seeds import check_seed

LOG = "transitions.csv"
RESULTS = "results.json"


@dataclass
class MachineEvaluateConfig(MachineSettings):
    """What `murmillo evaluate` takes for a machine; see `murmillo.cli.evaluate.HELP`."""

    worlds: int = 64
    seed: int = 12345
    seconds: float | None = None


def run(words: list[str]) -> int:
    """Let the machine try in many worlds; print the figures, keep them and the log of transitions."""
    settings, chosen = choose(MachineEvaluateConfig, words)
    if settings.worlds < 1:
        raise CommandError(f"worlds={settings.worlds}: needs at least 1 attempt")
    check_seed("seed", settings.seed)
    seconds = chosen.file.seconds if settings.seconds is None else settings.seconds
    if not 0.0 < seconds < math.inf:
        raise CommandError(f"seconds={seconds:g}: needs a number above 0")
    scene = MachineScene(settings, chosen, settings.worlds, seconds)
    try:
        attempts = attempt(scene, settings.seed)
        results = _results(settings, chosen, scene, seconds, attempts)
    finally:
        scene.close()
    folder = scene.below.folder / runs.MACHINES / chosen.variant
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(f"{folder}: cannot be made ({error.strerror or error})") from None
    runs.write_text(folder / LOG, _log(attempts.changes))
    runs.write_json(folder / RESULTS, results)
    tables.show(("", "this run", "CALM, table 2"), _rows(results), left=("",))
    print(f"every transition: {folder / LOG} (the figures: {RESULTS})")
    return 0


def _results(
    settings: MachineEvaluateConfig, chosen: Chosen, scene: MachineScene, seconds: float, attempts: Attempts
) -> dict[str, Any]:
    """What `results.json` has."""
    judged = scene.machine.success is not None
    times = attempts.time[attempts.time.isfinite()]
    heading = settings.heading if chosen.file.heads else None
    return {
        "machine": chosen.word,
        "task": chosen.file.task,
        "parameters": chosen.parameters,
        "run": str(scene.below.folder),
        "checkpoint": scene.below.digest(),
        "heading": heading,
        "heading_checkpoint": None if heading is None else checkpoint_digest(Path(heading) / runs.LAST),
        "seed": settings.seed,
        "seconds": seconds,
        "attempts": settings.worlds,
        "successes": len(times) if judged else None,
        "success_rate": len(times) / settings.worlds if judged else None,
        "published_success_rate": published_rate(chosen),
        "time_to_success": times.mean().item() if len(times) else None,
        "fall_rate": attempts.fell.float().mean().item(),
        "states": attempts.shares,
        "transitions": len(attempts.changes),
    }


def _rows(results: dict[str, Any]) -> list[tuple[str, str, str]]:
    """The table on the terminal: what, of this run, of the paper."""
    time, n = results["time_to_success"], results["attempts"]
    rows = [
        (
            f"Successful attempts of {n} ↑",
            _percent(results["success_rate"]),
            _percent(results["published_success_rate"]),
        ),
        ("Time to success, mean ↓", "-" if time is None else f"{time:.1f} s", "-"),
        ("Attempts with a fall ↓", _percent(results["fall_rate"]), "-"),
    ]
    return rows + [(f"Time in state {state}", _percent(part), "-") for state, part in results["states"].items()]


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _log(changes: list[Change]) -> str:
    """The transitions as CSV; `step` counts decisions, `time_s` is the attempt's."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("world", "step", "time_s", "from", "to", "condition"))
    for change in changes:
        writer.writerow((*change[:2], f"{change.time:.3f}", *change[3:]))
    return text.getvalue()
