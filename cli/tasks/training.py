"""One run of a task from its settings to its report: build, train, measure, film, report."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from murmillo.agents.common import checkpoint
from murmillo.agents.common.logger import Logger
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.agents.common.runner import Runner
from murmillo.cli import launch, runs
from murmillo.cli.devices import CPU
from murmillo.cli.evaluation.identity import clip_digests
from murmillo.cli.tasks import low, report, table
from murmillo.cli.tasks.checks import check_settings
from murmillo.cli.tasks.config import TaskTrainConfig
from murmillo.cli.tasks.evaluating import evaluate
from murmillo.cli.tasks.low import LowRun
from murmillo.cli.tasks.metrics import training_metrics
from murmillo.cli.tasks.world import World, make_policy, policy_meta
from murmillo.cli.training import film, follow, kept
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.devices import on
from murmillo.envs.motion.licences import terms_of


def train(config: TaskTrainConfig, suffix: str = "", ranks: Ranks = ALONE) -> int:
    """Train as the settings say; 0 also where a signal ended it early. `suffix` is put behind a default name.

    Ranks that share the run all call this; the first one writes, and measures in the end.

    Raises:
        CommandError, SuiteError, AgentError: a mistake in the settings; a new run's folder is then not left behind.
    """
    below = low.find(config.low)

    def check() -> TaskTrainConfig:
        check_settings(config, below)
        return config

    launch.agreed(ranks, check)
    choices = config.choices
    name = config.run.name or runs.default_name(
        f"{choices['task']}-{choices['agent']}", choices["budget"], config.seed, suffix
    )
    folder, resuming = launch.open_run(config, name, ranks)
    if resuming:
        low.check_unchanged(below, checkpoint.load(folder / runs.LAST))
    threads = launch.share_threads(config).threads
    world = World(config, below, config.num_envs // ranks.size, judged=True, threads=threads)
    try:
        with kept(folder, config, resuming, ranks), on(world.env.device):
            return _train(config, below, world, folder, resuming, ranks)
    finally:
        world.close()


def _train(
    config: TaskTrainConfig, below: LowRun | None, world: World, folder: Path, resuming: bool, ranks: Ranks
) -> int:
    policy, generator = make_policy(config, world, ranks)
    logger = Logger(folder) if ranks.first else None
    meta = policy_meta(config, world)
    to = folder / runs.LAST
    runner = Runner(world.decisions, policy, config.runner, generator, to, meta=meta, logger=logger, ranks=ranks)
    if resuming:
        runner.load(folder / runs.LAST)
    # after loading: they are kept with a checkpoint, and need not be those here
    runner.meta |= low.identity(below)
    note_clips(folder, runner, world.env, ranks)
    over = "on its own" if below is None else f"over {below.word} ({below.kind})"
    opening = f"{folder}: {config.choices['task']} {over}, {launch.worlds(config, ranks)}"
    stopped = follow(runner, folder, opening, metrics=training_metrics(config.latent_env.steps))

    def measured() -> dict[str, Any]:
        return evaluate(config, below, folder, config.run.measured_worlds)

    if not ranks.first:
        return 0
    with on(CPU):
        return complete(folder, runner.samples if stopped else None, measured, report.write, video=config.run.video)


def complete(
    folder: Path,
    stopped: int | None,
    measured: Callable[[], dict[str, Any]],
    write: Callable[[Path], Path],
    *,
    video: bool,
) -> int:
    """What comes after the training of a run: measure its policy, film it, report; of one that was stopped the report.

    Args:
        folder: of the run.
        stopped: samples at which a signal ended it; None where it was trained to its end.
        measured: what `evaluation/metrics.json` has.
        write: writes the report.
        video: film it.

    Returns:
        the exit status.
    """
    if stopped is not None:
        for name in (runs.MEASURES, runs.METRICS):  # of this run when it had ended before: no longer its figures
            (folder / name).unlink(missing_ok=True)
        write(folder)
        print(f"stopped at {stopped:,} samples; go on with: murmillo train run.resume={folder}")
        return 0
    print("measuring the policy before and after training", flush=True)
    runs.write_json(folder / runs.MEASURES, table.by_player(measured()))
    if video:
        film(folder)
    print(f"the report: {write(folder)}")
    return 0


def note_clips(folder: Path, runner: Runner, env: HumanoidVectorEnv, ranks: Ranks) -> None:
    """Keep under which terms the clips stand, with the checkpoint too, and which they are; the first rank writes."""
    terms = dataclasses.asdict(terms_of(env.library.clips))
    runner.meta["terms"] = terms
    if ranks.first:
        runs.write_json(folder / runs.TERMS, terms)
        runs.write_json(folder / runs.CLIPS, clip_digests(env.library.clips))
