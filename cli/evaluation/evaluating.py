"""An evaluation from its settings to its report: measure, keep, draw, tell."""

import dataclasses
import shutil
import time
from pathlib import Path
from typing import Any

from murmillo.cli import runs
from murmillo.cli.ages import measure_ages
from murmillo.cli.config import TrainConfig
from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation import history, report
from murmillo.cli.evaluation.bench import Bench, Measured, Request, open_bench
from murmillo.cli.evaluation.kept import kept_checkpoints
from murmillo.cli.evaluation.plots import plot_all
from murmillo.cli.evaluation.sources import TRAINED
from murmillo.cli.evaluation.table import METRICS

_CHUNKS = f"{runs.EVALUATION}/chunks"


def evaluate(config: TrainConfig, folder: Path, request: Request) -> dict[str, Any]:
    """Measure the run in `folder` and write the figures, plots and reports into it; those of a blend have their place.

    What was recorded stays in the folder: the same request later goes on from there.

    Returns:
        What `evaluation/metrics.json` has.

    Raises:
        CommandError: a metric that there is not or that this run's agent cannot give, the run kept no checkpoints, or
            its adapters cannot act as is asked.
        AgentError: there is no checkpoint, or it does not fit.
        SuiteError: the clips cannot be used.
    """
    begun = time.monotonic()
    if request.along and request.blend:
        raise CommandError(f"checkpoint=all: {request.blend} is measured of the last one alone; drop one of the two")
    into = request.blend.place(folder)
    kept = kept_checkpoints(folder) if request.along else {}
    if request.along and not kept:
        raise CommandError(
            f"checkpoint=all: {folder} kept none on its way; train with run.keep_every=SAMPLES, "
            f"or go on so with: murmillo train run.resume={folder} run.keep_every=SAMPLES runner.samples=MORE"
        )
    with open_bench(config, folder, request) as bench:
        last = bench.identity(folder / runs.LAST)["samples"]
        for samples, path in kept.items():
            if samples != last:
                _put_into_history(bench, samples, path)
        measured = bench.measure(folder / runs.LAST, into / _CHUNKS)
        results = {
            **measured.identity,
            "clips": _clips(bench),
            "hidden": list(config.agent.ppo.hidden),
            "left_out": bench.left_out,
            **({} if config.base is None or runs.MERGED in config.choices else {"base": config.base}),
            "seconds": round(time.monotonic() - begun, 1),
            "metrics": measured.metrics,
        }
    if request.worlds:
        motions = results["clips"]["motions"]
        moved = dataclasses.replace(config, env=dataclasses.replace(config.env, motions=motions))
        results["ages"] = measure_ages(moved, folder, request.worlds, request.seed, request.blend)
    return _keep(into, measured, results)


def _put_into_history(bench: Bench, samples: int, path: Path) -> None:
    """Measure a checkpoint that the run kept, unless its figures are there already."""
    table, identity = bench.folder / runs.HISTORY, bench.identity(path)
    known = history.known(table, identity)  # not all figures: who never fell has no time of recovery
    measured_before = all(any(kind.name in known for kind in metric.figures) for metric in bench.metrics)
    if identity["not_comparable"] or measured_before:
        return
    print(f"the checkpoint of {samples:,} samples", flush=True)
    chunks = bench.folder / f"{_CHUNKS}-{samples}"
    measured = bench.measure(path, chunks, (TRAINED,))
    history.add(table, {**measured.identity, "metrics": measured.metrics})
    shutil.rmtree(chunks)  # a long run keeps many checkpoints, and its figures stay


def _clips(bench: Bench) -> dict[str, Any]:
    library, scene = bench.env.library, bench.scene
    return {
        "motions": bench.request.motions or bench.config.env.motions,
        "count": len(library.clips),
        "distinct": len(scene.distinct),
        "names": scene.names,
        "duplicates": scene.duplicates,
        "seconds": round(library.duration.sum().item(), 2),
    }


def _keep(folder: Path, measured: Measured, results: dict[str, Any]) -> dict[str, Any]:
    """Write all that is to be read; metrics that were measured before under the same conditions stay."""
    before, curves = runs.read_json(folder / runs.METRICS, {}), measured.curves
    if all(before.get(name) == value for name, value in measured.identity.items()):
        results = {**before, **results, "metrics": _in_order({**before["metrics"], **results["metrics"]})}
        curves = _in_order({**runs.read_json(folder / runs.CURVES, {}), **curves})
    runs.write_json(folder / runs.METRICS, results)
    runs.write_json(folder / runs.CURVES, curves)
    if results["not_comparable"] is None:
        history.add(folder / runs.HISTORY, results)
    pictures = plot_all(results, curves, history.read(folder / runs.HISTORY), folder / runs.EVALUATION / runs.PLOTS)
    report.write(folder, results, pictures)
    return results


def _in_order(entries: dict[str, Any]) -> dict[str, Any]:
    """As the table of metrics has them."""
    return {name: entries[name] for name in METRICS if name in entries}
