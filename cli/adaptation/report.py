"""`report.md` of a run of AdaptNet: what was trained, what came of it, what the figures mean, how to go on."""

import shlex
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from murmillo.cli import report as common
from murmillo.cli import runs
from murmillo.cli.adaptation.metrics import CURVES, TRAINING
from murmillo.cli.adaptation.published import imitation_error
from murmillo.cli.plots import Scalars
from murmillo.cli.tasks import plots, table


def write(folder: Path) -> Path:
    """Write the report and its plots from what lies in the run's folder; the report's path."""
    scalars = common.read_scalars(folder / runs.SCALARS)
    config = OmegaConf.load(folder / runs.CONFIG)
    clips = list(runs.read_json(folder / runs.CLIPS, {}))
    return common.assemble(
        folder,
        scalars,
        what=_what(config, scalars),
        found=[_figures(config, runs.read_json(folder / runs.METRICS), clips)],
        draw=lambda: [plots.plot_learning(scalars, 1, folder / runs.PLOTS, CURVES)],
        going_on=_going_on(folder, config, scalars),
        metrics=TRAINING,
    )


def _what(config: Any, scalars: Scalars) -> str:
    choices = config.choices
    samples, minutes, rate = common.Effort.of(scalars)
    clips = f"`{config.motions}`" + (f" ({', '.join(config.clips)})" if config.clips else "")
    ablation = "" if choices.ablation == "none" else f" with the ablation `{choices.ablation}`"
    what = (
        f"A base policy of AdaptNet learned to {config.task.gait} to places in the style of the clips {clips}"
        if config.stage == "base"
        else f"The policy of `{config.base}` was adapted to `{choices.to}` by `{choices.method}`{ablation}, "
        f"with the clips {clips}"
    )
    return (
        f"{what}, with the budget `{choices.budget}`, seed {config.seed}: {samples:,} samples (control steps of "
        f"1/30 s, {samples / 30 / 3600:.1f} simulated hours) in {minutes:.1f} minutes, {rate:,.0f} samples/s, in "
        f"{config.num_envs} worlds.{common.merged(choices)}"
    )


def _figures(config: Any, results: dict[str, Any] | None, clips: list[str]) -> str:
    if results is None:
        return ""
    begun = (
        " Before training, an adapted policy acts as its base: that column is the base, put into this world."
        if config.stage == "adapt" and config.choices.method == "adaptnet" and runs.MERGED not in config.choices
        else ""
    )
    return "\n\n".join(
        text
        for text in (
            "## What came of it",
            f"{results['trajectories']:,} episodes for each, begun as `env.starts` says, with mean actions, after "
            f"{results['samples']:,} samples, seed {results['seed']}.{begun}",
            table.markdown(results),
            table.meanings(results),
            _published(results, clips),
        )
        if text
    )


def _published(results: dict[str, Any], clips: list[str]) -> str:
    """The paper's figure beside ours, for a clip of the name of one of its styles; or why there is none of ours."""
    if "imitation_error" not in results["metrics"]["task"]["figures"]:
        return "No imitation error: no clip is short enough to be one motion, or no episode lasted half a second."
    if len(clips) != 1 or (paper := imitation_error(clips[0])) is None:
        return ""
    return (
        f"The paper reports an imitation error of {paper:.2f} m for its style of this name (table 2): of another "
        "recording, by positions in the world, after at least ten minutes on a GPU."
    )


def _going_on(folder: Path, config: Any, scalars: Scalars) -> str:
    run = shlex.quote(str(folder))
    if runs.MERGED in config.choices:
        return common.going_on(common.train_film_measure(folder, scalars, merged=True))
    lines = common.train_film_measure(folder, scalars)
    if config.stage == "base":
        lines += [
            "# give it another style, and slippery ground",
            f"murmillo train agent=adaptnet stage=adapt base={run} to=style clips=[jaunty] run.name=jaunty",
            f"murmillo train agent=adaptnet stage=adapt base={run} to=friction run.name=slippery",
        ]
    elif config.choices.method == "adaptnet":
        lines += [
            "# half way between the base and this, and both latent spaces as a map",
            f"murmillo record run={run} alpha=0.5",
            f"murmillo map {shlex.quote(config.base)} {run}",
        ]
    return common.going_on(lines)
