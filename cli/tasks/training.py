"""One run of a task from its settings to its report: build, train, measure, film, report."""

import dataclasses
from pathlib import Path
from typing import Any

import torch

from murmillo.agents.common import checkpoint
from murmillo.agents.common.logger import Logger
from murmillo.agents.common.runner import Runner
from murmillo.cli import runs, versions
from murmillo.cli.devices import CPU
from murmillo.cli.evaluation.identity import clip_digests
from murmillo.cli.tasks import low, report, table
from murmillo.cli.tasks.checks import check_settings
from murmillo.cli.tasks.config import TaskTrainConfig
from murmillo.cli.tasks.evaluating import evaluate
from murmillo.cli.tasks.low import LowRun
from murmillo.cli.tasks.metrics import training_metrics
from murmillo.cli.tasks.world import World, make_policy, policy_meta
from murmillo.cli.training import describe, film, follow, undone_by_mistakes
from murmillo.envs.devices import on
from murmillo.envs.motion.licences import terms_of


def train(config: TaskTrainConfig, suffix: str = "") -> int:
    """Train as the settings say; 0 also where a signal ended it early. `suffix` is put behind a default name.

    Raises:
        CommandError, SuiteError, AgentError: a mistake in the settings; a new run's folder is then not left behind.
    """
    below = low.find(config.low)
    check_settings(config, below)
    resuming = config.run.resume is not None
    choices = config.choices
    name = config.run.name or runs.default_name(
        f"{choices['task']}-{choices['agent']}", choices["budget"], config.seed, suffix
    )
    folder = Path(config.run.resume) if config.run.resume else runs.vacant(config.run.root, name)
    config.run.name = name
    if resuming:
        low.check_unchanged(below, checkpoint.load(folder / runs.LAST))
    torch.set_num_threads(config.threads or versions.usable_cores())
    world = World(config, below, config.num_envs, judged=True)
    try:
        if not resuming:
            runs.make(folder)
        with undone_by_mistakes(folder, resuming), on(world.env.device):
            describe(folder, config)
            return _train(config, below, world, folder, resuming)
    finally:
        world.close()


def _train(config: TaskTrainConfig, below: LowRun | None, world: World, folder: Path, resuming: bool) -> int:
    policy, generator = make_policy(config, world)
    logger = Logger(folder)
    meta = policy_meta(config, world)
    runner = Runner(world.decisions, policy, config.runner, generator, folder / runs.LAST, meta=meta, logger=logger)
    if resuming:
        runner.load(folder / runs.LAST)
    # after loading: they are kept with a checkpoint, and need not be those here
    terms = dataclasses.asdict(terms_of(world.env.library.clips))
    runner.meta |= {"terms": terms, **low.identity(below)}
    runs.write_json(folder / runs.TERMS, terms)
    runs.write_json(folder / runs.CLIPS, clip_digests(world.env.library.clips))
    over = "on its own" if below is None else f"over {below.word} ({below.kind})"
    opening = f"{folder}: {config.choices['task']} {over}, {config.num_envs} worlds"
    if follow(runner, folder, opening, metrics=training_metrics(config.latent_env.steps)):
        for name in (runs.MEASURES, runs.METRICS):  # of this run when it had ended before: no longer its figures
            (folder / name).unlink(missing_ok=True)
        report.write(folder)
        print(f"stopped at {runner.samples:,} samples; go on with: murmillo train run.resume={folder}")
        return 0
    with on(CPU):
        _finish(config, below, folder)
    return 0


def _finish(config: TaskTrainConfig, below: LowRun | None, folder: Path) -> None:
    """Measure the policy beside what it is to be better than, film it, write the report."""
    print("measuring the policy before and after training", flush=True)
    results: dict[str, Any] = evaluate(config, below, folder, config.run.measured_worlds)
    runs.write_json(folder / runs.MEASURES, table.by_player(results))
    if config.run.video:
        film(folder)
    print(f"the report: {report.write(folder)}")
