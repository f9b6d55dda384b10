"""What a comparison reads of a run's folder: its settings, the log of its training and the figures of its policy."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from yaml import YAMLError

from murmillo.cli import runs
from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation import history, sources
from murmillo.cli.metrics import EPISODE_LENGTH, TRAINING
from murmillo.cli.plots import Scalars
from murmillo.cli.report import read_scalars

LAST_PART = 0.1
"""Share of the training, at its end, whose mean stands for the whole in a table."""

TRAINED, LOG, EVALUATION = "trained policy", "training", "evaluation"
COVERAGES = ("coverage", "coverage_10")
"""Figures of an evaluation that are shown first, and over the samples: of all clips, and filtered at 10 %."""


class Quantity(NamedTuple):
    """Something that is measured. Two figures stand side by side only where all of this is equal.

    Attributes:
        source: which of `measures.json`, the training's log and the evaluation it comes from.
        name: in that file.
        title: for a reader.
        unit: of the value.
        better: "up" or "down", which way is good; empty where neither is.
        protocol: how it was measured, of an evaluation.
    """

    source: str
    name: str
    title: str
    unit: str = ""
    better: str = ""
    protocol: str = ""


STYLE_SCORE = Quantity(TRAINED, "score", "Style score", "", "up")
NORMALISED_RETURN = Quantity(TRAINED, "normalised_return", "Normalised return", "", "up")
LENGTH = Quantity(TRAINED, "length", "Episode length", "steps", "up")
FALLS = Quantity(TRAINED, "fall_rate", "Fall rate", "", "down")
SAMPLES = Quantity(LOG, "samples", "Samples")
HOURS = Quantity(LOG, "hours", "Training time", "h")
THROUGHPUT = Quantity(LOG, "samples_per_second", "Throughput", "samples/s", "up")

_MEASURES = {
    quantity.name: quantity
    for quantity in (
        STYLE_SCORE,
        LENGTH,
        FALLS,
        Quantity(TRAINED, "rewards.style", "Style reward", "", "up"),
        Quantity(TRAINED, "rewards.skill", "Skill reward", "", "up"),
        Quantity(TRAINED, "heads.right", "Head of the commanded skill", "", "up"),
        Quantity(TRAINED, "heads.other", "Other heads"),
        Quantity(TRAINED, "residual_share", "Residual share", "", "down"),
        Quantity(TRAINED, "concentration", "Fisher concentration", "", "down"),
        NORMALISED_RETURN,
        Quantity(TRAINED, "reach_error", "Distance of the sword's tip from the target", "m", "down"),
        Quantity(TRAINED, "heading_cosine", "Cosine of movement and its direction", "", "up"),
        Quantity(TRAINED, "goal_reward", "Goal reward", "", "up"),
        Quantity(TRAINED, "imitation_error", "Imitation error", "m", "down"),
        Quantity(TRAINED, "style_success", "Share of steps in the commanded style", "", "up"),
        Quantity(TRAINED, "early_rate", "Share of episodes that ended early", "", "down"),
    )
}
_COUNTS = ("episodes", "steps")
"""How much was measured, not what came of it."""


@dataclass(frozen=True, eq=False)
class Run:
    """One run.

    Attributes:
        folder: where it lies.
        settings: its configuration by dotted name.
        scalars: its log, with at least one iteration; `samples` are control steps.
        history: coverage of the checkpoints that were evaluated, by name; empty where none was.
        figures: what was measured.
        clips: digests of its clips by name, where the run kept them.
        versions: of the code and the machine, as the run kept them.
    """

    folder: Path
    settings: dict[str, Any]
    scalars: Scalars
    history: Scalars
    figures: dict[Quantity, float]
    clips: dict[str, str]
    versions: dict[str, Any]

    @property
    def agent(self) -> str:
        return str(self.settings.get("choices.agent", "unknown agent"))

    @property
    def seed(self) -> Any:
        return self.settings.get("seed")

    @property
    def samples(self) -> float:
        return float(self.scalars["samples"][-1])

    def mean_until(self, scalar: str, samples: float) -> float:
        """Mean of a scalar of the log over the last tenth of the first `samples`; NaN where it has none there."""
        counted = self.scalars["samples"]
        inside = (counted > (1.0 - LAST_PART) * samples) & (counted <= samples)
        values = self.scalars.get(scalar, np.full(len(counted), np.nan))[inside]
        known = values[np.isfinite(values)]
        return float(known.mean()) if len(known) else float("nan")


def read(folder: Path) -> Run | None:
    """The run in `folder`; None where it never finished an iteration.

    Raises:
        CommandError: one of its files cannot be read.
    """
    with _reading(folder / runs.CONFIG) as path:
        settings = _flat(yaml.safe_load(path.read_text(encoding="utf-8")))
    with _reading(folder / runs.SCALARS) as path:
        scalars = read_scalars(path)
    if not len(scalars["samples"]):
        return None
    with _reading(folder / runs.MEASURES) as path:
        figures = dict(_measured(runs.read_json(path, {})))
    with _reading(folder / runs.METRICS) as path:
        figures |= _evaluated(runs.read_json(path, {}), scalars["samples"][-1])
    with _reading(folder / runs.HISTORY) as path:
        coverages = _history(path, scalars)
    with _reading(folder / runs.CLIPS) as path:
        clips = dict(runs.read_json(path, {}))
    with _reading(folder / runs.VERSIONS) as path:
        versions = dict(runs.read_json(path, {}))
    # a decision of a high-level policy counts as the control steps that it takes, which all runs have in common
    for counted in {"samples", EPISODE_LENGTH.scalar} & scalars.keys():
        scalars[counted] = settings.get("latent_env.steps", 1) * scalars[counted]
    run = Run(folder, settings, scalars, coverages, figures, clips, versions)
    figures |= _logged(run)
    return run


@contextmanager
def _reading(path: Path) -> Iterator[Path]:
    """Whatever is wrong with a file that people may have touched, in one line."""
    try:
        yield path
    except (OSError, ValueError, YAMLError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CommandError(f"{path}: cannot be read ({reason}); mend it, or leave this run out") from None
    except (LookupError, TypeError, AttributeError):
        raise CommandError(f"{path}: is not what murmillo writes there; mend it, or leave this run out") from None


def _measured(ages: dict[str, Any]) -> Iterator[tuple[Quantity, float]]:
    """Figures of the trained policy in `measures.json`."""
    for name, value in _numbers(ages.get("trained", {})):
        if name not in _COUNTS:
            yield _MEASURES.get(name, Quantity(TRAINED, name, _title(name))), value


def _evaluated(results: dict[str, Any], samples: float) -> Iterator[tuple[Quantity, float]]:
    """Figures of the trained policy in `evaluation/metrics.json`; a share in per cent, as its unit says."""
    for metric in results.get("metrics", {}).values():
        conditions = [*metric["protocols"], f"{results['trajectories']:,} trajectories", f"start {results['start']}"]
        if results["samples"] != samples:
            conditions.append(f"the policy at {results['samples']:,} samples")
        if results["not_comparable"]:
            conditions.append(results["not_comparable"])
        for name, figure in metric["figures"].items():
            value = figure["values"].get(sources.TRAINED, {}).get("value")
            if value is not None:
                described = (figure["title"], figure["unit"], figure["better"])
                scale = 100.0 if figure["unit"] == "%" else 1.0
                yield Quantity(EVALUATION, name, *described, "; ".join(conditions)), scale * value


def _logged(run: Run) -> Iterator[tuple[Quantity, float]]:
    """Figures of the training's log."""
    for metric in TRAINING:
        value = run.mean_until(metric.scalar, run.samples)
        if np.isfinite(value):
            yield Quantity(LOG, metric.scalar, f"{metric.title} while training", metric.unit), value
    seconds = float(run.scalars["seconds"][-1])
    yield SAMPLES, run.samples
    yield HOURS, seconds / 3600.0
    yield THROUGHPUT, run.samples / seconds


def _history(path: Path, scalars: Scalars) -> Scalars:
    """Columns of the evaluations of a run's checkpoints, those made like the latest one, over samples and seconds."""
    rows = history.read(path)
    if not rows:
        return {}
    like = [row for row in rows if all(row[name] == rows[-1][name] for name in ("trajectories", "start"))]
    latest = list({row["samples"]: row for row in like}.values())
    samples = np.array([float(row["samples"]) for row in latest])
    seconds = np.interp(samples, scalars["samples"], scalars["seconds"])
    values = {name: np.array([float(row.get(name, "nan")) for row in latest]) for name in COVERAGES}
    return {"samples": samples, "seconds": seconds, **values}


def _numbers(values: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, float]]:
    """The finite numbers of nested values by dotted name."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _numbers(value, f"{prefix}{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value):
            yield f"{prefix}{name}", float(value)


def _title(name: str) -> str:
    words = name.replace("_", " ").replace(".", ": ")
    return words[:1].upper() + words[1:]


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat = {}
    for name, value in values.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return flat
