"""`report.md` of a run: what was trained, what came of it, what the figures mean, how to go on."""

import csv
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from omegaconf import OmegaConf

from murmillo.cli import encodings, obedience, runs
from murmillo.cli.evaluation import report as evaluation
from murmillo.cli.metrics import LABELS, TRAINING, Metric
from murmillo.cli.plots import Scalars, plot_all
from murmillo.cli.rollouts import AGES
from murmillo.envs.motion.licences import Terms

_MAX_ROWS = 12


def write(folder: Path) -> Path:
    """Write the report and its plots from what lies in the run's folder; the report's path."""
    scalars = read_scalars(folder / runs.SCALARS)
    config = OmegaConf.load(folder / runs.CONFIG)
    measures = runs.read_json(folder / runs.MEASURES, {})
    return assemble(
        folder,
        scalars,
        what=_what(config, scalars),
        found=[
            _ages(measures, adapted="to" in config.choices and runs.MERGED not in config.choices),
            obedience.section(measures, runs.read_json(folder / runs.SKILLS, {})),
            encodings.section(measures),
            evaluation.section(runs.read_json(folder / runs.METRICS)),
        ],
        draw=lambda: plot_all(scalars, folder / runs.PLOTS),
        going_on=_going_on(folder, config, scalars),
    )


def assemble(
    folder: Path,
    scalars: Scalars,
    *,
    what: str,
    found: Sequence[str],
    draw: Callable[[], list[Path]],
    going_on: str,
    metrics: tuple[Metric, ...] = TRAINING,
) -> Path:
    """Write `report.md` of any run; its path.

    Args:
        folder: of the run.
        scalars: of its log.
        what: was trained, in a sentence or two.
        found: sections on what came of it; empty ones are left out.
        draw: makes the plots, once an iteration has been made.
        going_on: the last section.
        metrics: of the log that are shown.
    """
    sections = [
        f"# {folder.name}",
        f"{what}\n\n{made_on(runs.read_json(folder / runs.VERSIONS, {}))}",
        terms(runs.read_json(folder / runs.TERMS)),
        film(folder),
        notices(runs.read_json(folder / runs.NOTICES, [])),
        *found,
    ]
    if len(scalars["samples"]):
        sections += [first_and_last(scalars, metrics), minutes(scalars, metrics), pictures(draw(), folder)]
    sections += [meanings(scalars, metrics), going_on]
    path = folder / runs.REPORT
    runs.write_text(path, "\n\n".join(section for section in sections if section) + "\n")
    return path


def going_on(lines: Sequence[str]) -> str:
    """The last section: commands, and what each is for."""
    return "\n".join(["## How to go on", "", "```", *lines, "```"])


def train_film_measure(folder: Path, scalars: Scalars, merged: bool = False) -> list[str]:
    """Commands for a run of a task or of AdaptNet, whatever came of it; what was `merged` is not trained on."""
    run = shlex.quote(str(folder))
    samples = max(5_000_000, 2 * Effort.of(scalars).samples)
    going_on = [
        "# train this run on, for an hour at most",
        f"murmillo train run.resume={run} runner.max_minutes=60 runner.samples={samples}",
    ]
    return [
        *([] if merged else going_on),
        "# another film, and surer figures",
        f"murmillo record run={run} seconds=20",
        f"murmillo evaluate run={run} worlds=1024",
    ]


class Effort(NamedTuple):
    """What a training has taken: samples, minutes, and samples a second."""

    samples: int
    minutes: float
    rate: float

    @classmethod
    def of(cls, scalars: Scalars) -> "Effort":
        """By the log; all 0 before the first iteration."""
        if not len(scalars["samples"]):
            return cls(0, 0.0, 0.0)
        samples, seconds = int(scalars["samples"][-1]), float(scalars["seconds"][-1])
        return cls(samples, seconds / 60.0, samples / seconds if seconds else 0.0)


def read_scalars(path: Path) -> Scalars:
    """Columns of `scalars.csv`, with `seconds` [s] of training since the beginning; no rows where it is missing."""
    if not path.is_file():
        return {"samples": np.zeros(0), "seconds": np.zeros(0)}
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    table = np.array([[float(cell) if cell else np.nan for cell in row] for row in rows]).reshape(-1, len(header))
    scalars = dict(zip(header, table.T, strict=True))
    steps = np.diff(scalars["samples"], prepend=0.0)
    scalars["seconds"] = np.cumsum(steps / scalars["samples_per_second"])
    return scalars


def _what(config: Any, scalars: Scalars) -> str:
    choices, (samples, minutes, rate) = config.choices, Effort.of(scalars)
    chosen = f" ({', '.join(config.clips)})" if config.get("clips") else ""
    changed = "" if choices.ablation == "none" else f" with the ablation `{choices.ablation}`"
    learned = f"of `{config.base}` was adapted to `{choices.to}` with" if "to" in choices else "learned from"
    return (
        f"`{choices.agent}`{changed} {learned} the clips `{config.motions}`{chosen} with the budget "
        f"`{choices.budget}`, seed {config.seed}: {samples:,} samples (control steps of 1/30 s, "
        f"{samples / 30 / 3600:.1f} simulated hours) in {minutes:.1f} minutes, {rate:,.0f} samples/s, "
        f"in {config.num_envs} worlds.{merged(choices)}"
    )


def merged(choices: Any) -> str:
    """That a run was merged, and of what; nothing of others."""
    if runs.MERGED not in choices:
        return ""
    return f" This run is the policy of `{choices[runs.MERGED]}` and its adapters as one network, which learns no more."


def made_on(versions: dict[str, Any]) -> str:
    """The machine, the software and where all settings are."""
    machine, packages, git = (versions.get(name, {}) for name in ("machine", "packages", "git"))
    commit = f"{git['commit'][:12]}{', changed' if git['dirty'] else ''}" if git.get("commit") else "no checkout"
    return (
        f"Made on {machine.get('processor', 'an unknown processor')}, {machine.get('cores', '?')} cores, "
        f"{versions.get('threads', '?')} threads; Python {machine.get('python', '?')}, "
        f"torch {packages.get('torch', '?')}, mujoco {packages.get('mujoco', '?')}, sources {commit}. "
        "All settings: [`config.yaml`](config.yaml)."
    )


def terms(found: dict[str, Any] | None) -> str:
    """What the licences of the clips come to for the weights; of runs that have kept them."""
    return f"Learned from clips under these {Terms(**found)}" if found else ""


def film(folder: Path) -> str:
    if (folder / runs.VIDEO).is_file():
        return f"The trained character: [`{runs.VIDEO}`]({runs.VIDEO})"
    reason = runs.read_json(folder / runs.FILMING, {}).get("reason")
    return f"No video: {reason}" if reason else ""


def notices(found: list[dict[str, Any]]) -> str:
    """The failures that the runner saw, and whether they are over."""
    if not found:
        return ""
    lines = []
    for notice in found:
        over = "" if notice["over"] is None else f" (Over at {notice['over']:,}.)"
        lines.append(f"- At {notice['samples']:,} samples: {notice['text']}.{over}")
    hint = "`runner.*` can be set when this run is taken up again; all else needs a new run."
    return "\n".join(["## What to look at", "", *lines, "", hint])


def _ages(measures: dict[str, Any], adapted: bool) -> str:
    """The table of the policy at its ages; before training an adapted one is its base."""
    if not measures:
        return ""
    rows = [
        f"| {AGES[age]} | {m['length']:.1f} | {m['fall_rate']:.2f} | {m['score']:.3f} "
        f"| {m['episodes']} | {m['steps']:,} |"
        for age, m in measures.items()
    ]
    text = [
        "## Did it learn?",
        "",
        "Each policy played one episode in each world: started in a clip, with its mean action and random latents, "
        "until it fell or the clock ran out. The style score is how much like a clip the *trained* "
        "discriminator finds the motion, 0 to 1; one judge for all makes the ages comparable.",
        *(["", "Before training, an adapted policy acts as its base: that row is the base, in this world."] * adapted),
        "",
        "| policy | episode length [steps] | fall rate | style score | episodes | steps |",
        "|---|---:|---:|---:|---:|---:|",
        *rows,
    ]
    if "warm_started" in measures and "untrained" in measures:
        before, after = measures["untrained"]["length"], measures["warm_started"]["length"]
        text += [
            "",
            "The warm start, a regression on what leads along the clips before the first sample, changed the length of "
            f"an episode by {after - before:+.1f} steps.",
        ]
    if shares := [m["residual_share"] for m in measures.values() if m.get("residual_share") is not None]:
        text += [
            "",
            f"Residual forces: after training, {100 * shares[-1]:.2f} % of the PD control, as the mean L2 norm of all "
            "residual forces [N] to that of all joint torques [N m] (the paper reports 0.842 %).",
        ]
    return "\n".join(text)


def _mean(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _present(scalars: Scalars, metrics: tuple[Metric, ...] = TRAINING) -> list[Metric]:
    return [metric for metric in metrics if metric.scalar in scalars]


def first_and_last(scalars: Scalars, metrics: tuple[Metric, ...] = TRAINING + LABELS) -> str:
    """The first minute against the last one while training; in a short run, its first quarter against its last."""
    seconds = scalars["seconds"]
    span = min(60.0, seconds[-1] / 4.0)
    first, last = seconds <= max(span, seconds[0]), seconds > seconds[-1] - span
    rows = [
        f"| {m.title} | {m.show(_mean(scalars[m.scalar][first]))} | {m.show(_mean(scalars[m.scalar][last]))} |"
        for m in _present(scalars, metrics)
    ]
    return "\n".join(
        [
            "## While training",
            "",
            "Means over all worlds, which start as the setting `env.starts` says and act with exploration noise "
            "on top.",
            "",
            f"| | first {span:.0f} s | last {span:.0f} s |",
            "|---|---:|---:|",
            *rows,
        ]
    )


def minutes(scalars: Scalars, metrics: tuple[Metric, ...] = TRAINING) -> str:
    """At most twelve rows of equal time."""
    shown, seconds = _present(scalars, metrics), scalars["seconds"]
    width = 60.0 * max(1.0, np.ceil(seconds[-1] / 60.0 / _MAX_ROWS))
    rows = []
    for begin in np.arange(0.0, seconds[-1], width):
        inside = (seconds > begin) & (seconds <= begin + width)
        if inside.any():
            figures = " | ".join(m.show(_mean(scalars[m.scalar][inside])) for m in shown)
            minute, samples = min(begin + width, seconds[-1]) / 60.0, int(scalars["samples"][inside][-1])
            rows.append(f"| {minute:.1f} | {samples:,} | {figures} |")
    titles = " | ".join(m.title for m in shown)
    return "\n".join([f"| minute | samples | {titles} |", f"|---:|---:|{'---:|' * len(shown)}", *rows])


def pictures(plots: list[Path], folder: Path) -> str:
    names = [plot.relative_to(folder).as_posix() for plot in plots]
    return "\n\n".join(f"![{Path(name).stem.replace('_', ' ')}]({name})" for name in names)


def meanings(scalars: Scalars, metrics: tuple[Metric, ...] = TRAINING + LABELS) -> str:
    lines = (f"- **{m.title}**: {m.meaning}" for m in _present(scalars, metrics) or TRAINING)
    return "\n".join(["## What the figures mean", "", *lines])


def _going_on(folder: Path, config: Any, scalars: Scalars) -> str:
    samples = Effort.of(scalars).samples
    run = shlex.quote(str(folder))
    lines = []
    if runs.MERGED not in config.choices:
        lines += [
            "# train this run on, for an hour at most",
            f"murmillo train run.resume={run} runner.max_minutes=60 runner.samples={max(20_000_000, 2 * samples)}",
        ]
    if config.choices.budget == "smoke" and "to" not in config.choices:
        clips = "" if config.motions == "builtin" else f" {shlex.quote(f'motions={config.motions}')}"
        clips += " " + shlex.quote(f"clips=[{','.join(config.clips)}]") if config.get("clips") else ""
        lines += [
            "# a better fighter, in two hours",
            f"murmillo train agent={config.choices.agent} budget=laptop{clips}",
        ]
    lines += [
        "# another film, and surer figures",
        f"murmillo record run={run} seconds=20",
        f"murmillo evaluate run={run} trajectories=1000",
        "# the curves of all runs, live",
        f"tensorboard --logdir {shlex.quote(str(folder.parent))}",
    ]
    return going_on(lines)
