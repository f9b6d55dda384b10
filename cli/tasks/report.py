"""`report.md` of a run that learned a task: what was trained, how well it is done, what that means, how to go on."""

import shlex
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from murmillo.cli import report as common
from murmillo.cli import runs
from murmillo.cli.plots import Scalars
from murmillo.cli.tasks import plots, table
from murmillo.cli.tasks.low import NONE
from murmillo.cli.tasks.metrics import training_metrics
from murmillo.cli.tasks.verdict import verdict


def write(folder: Path) -> Path:
    """Write the report and its plots from what lies in the run's folder; the report's path."""
    scalars = common.read_scalars(folder / runs.SCALARS)
    config = OmegaConf.load(folder / runs.CONFIG)
    return common.assemble(
        folder,
        scalars,
        what=_what(config, scalars),
        found=[_figures(config, runs.read_json(folder / runs.METRICS))],
        draw=lambda: [plots.plot_learning(scalars, config.latent_env.steps, folder / runs.PLOTS)],
        going_on=_going_on(folder, config, scalars),
        metrics=training_metrics(config.latent_env.steps),
    )


def _what(config: Any, scalars: Scalars) -> str:
    choices, steps = config.choices, config.latent_env.steps
    samples, minutes, rate = common.Effort.of(scalars)
    how = (
        'acting on the character\'s own action, with no policy below ("Scratch")'
        if config.low == NONE
        else f"by latents that the policy of `{config.low}` (`{choices.agent}`) follows"
    )
    unit = "control steps of 1/30 s" if steps == 1 else f"decisions of {steps} control steps of 1/30 s"
    return (
        f"A policy learned the task `{choices.task}` {how}, with the budget `{choices.budget}`, seed {config.seed}: "
        f"{samples:,} samples ({unit}, {samples * steps / 30 / 3600:.1f} simulated hours) in {minutes:.1f} minutes, "
        f"{rate:,.0f} samples/s, in {config.num_envs} worlds."
    )


def _figures(config: Any, results: dict[str, Any] | None) -> str:
    if results is None:
        return ""
    random = (
        " Random latents, drawn anew for every decision, are what the low-level policy gives without one above it."
        if config.low != NONE
        else ""
    )
    styles = " One style is commanded throughout an episode." if "styles" in results["metrics"] else ""
    return "\n\n".join(
        text
        for text in (
            "## Does it do the task?",
            f"{results['trajectories']:,} episodes for each, begun as `env.starts` says, with mean actions, after "
            f"{results['samples']:,} samples, seed {results['seed']}.{styles}{random}",
            table.markdown(results),
            verdict(results, config.env.episode_steps),
            table.styles_markdown(results),
            table.meanings(results),
            table.published(results["task"]),
        )
        if text
    )


def _going_on(folder: Path, config: Any, scalars: Scalars) -> str:
    run = shlex.quote(str(folder))
    lines = common.train_film_measure(folder, scalars)
    if config.low != NONE:
        lines += [
            "# the same task without a policy below, and the two side by side",
            f"murmillo train task={config.choices.task} low=none run.name=scratch",
            f"murmillo compare {run} {shlex.quote(str(folder.parent / 'scratch'))}",
        ]
    return common.going_on(lines)
