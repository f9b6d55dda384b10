"""One run from its settings to its report: build, warm start, train, measure, film, report."""

import dataclasses
import math
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import torch

from murmillo.agents.common import checkpoint
from murmillo.agents.common.exactness import choose, exactness
from murmillo.agents.common.guided_start import guided_start
from murmillo.agents.common.interface import Labelled
from murmillo.agents.common.logger import Logger
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.agents.common.runner import Runner
from murmillo.agents.common.warm_start import warm_start
from murmillo.cli import bases, launch, report, runs, versions
from murmillo.cli import config as configuration
from murmillo.cli.agents import checkpoint_meta, make_agent
from murmillo.cli.ages import measure_ages
from murmillo.cli.checks import check_clips, check_settings
from murmillo.cli.config import TrainConfig
from murmillo.cli.devices import CPU, for_training
from murmillo.cli.errors import user_errors
from murmillo.cli.evaluation.bench import Request
from murmillo.cli.evaluation.evaluating import evaluate
from murmillo.cli.evaluation.identity import clip_digests
from murmillo.cli.evaluation.kept import Keeper
from murmillo.cli.evaluation.table import QUICK
from murmillo.cli.metrics import TRAINING, Metric
from murmillo.cli.progress import Progress, make_progress
from murmillo.cli.skill_log import SkillLogger
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.devices import on
from murmillo.envs.motion.licences import terms_of

FILM_S = 6
"""Length of the film: without a graphics card a second of it takes five to draw."""


def train(config: TrainConfig, suffix: str = "", ranks: Ranks = ALONE) -> int:
    """Train as the settings say; 0 also where a signal ended it early. `suffix` is put behind a default name.

    Ranks that share the run all call this; the first one writes, and measures in the end.

    Raises:
        CommandError, SuiteError, AgentError: a mistake in the settings; a new run's folder is then not left behind.
    """
    choices = config.choices

    def check() -> TrainConfig:
        check_settings(config)
        if config.run.resume is None:  # what was begun has its base in its own checkpoint
            bases.check(config)
        check_clips(config)
        return config

    launch.agreed(ranks, check)
    kind = choices["agent"] if config.base is None else f"{choices['agent']}-{choices['to']}"
    name = config.run.name or runs.default_name(kind, choices["budget"], config.seed, suffix)
    folder, resuming = launch.open_run(config, name, ranks)
    env = HumanoidVectorEnv(config.num_envs // ranks.size, for_training(launch.share_threads(config)))
    try:
        with kept(folder, config, resuming, ranks), on(env.device):
            return _train(config, env, folder, resuming, ranks)
    finally:
        env.close()


@contextmanager
def kept(folder: Path, config: Any, resuming: bool, ranks: Ranks = ALONE) -> Iterator[None]:
    """Within, the run's folder is there, with its settings; only the first rank has a hand in that."""
    if not ranks.first:
        yield
        return
    if not resuming:
        runs.make(folder)
        launch.mark(folder)
    with undone_by_mistakes(folder, resuming):
        describe(folder, config)
        yield


@contextmanager
def undone_by_mistakes(folder: Path, resuming: bool) -> Iterator[None]:
    """A mistake that shows only now takes a new run's folder away, and gives a resumed one its own settings back."""
    former = {name: (folder / name).read_bytes() for name in (runs.CONFIG, runs.VERSIONS) if (folder / name).exists()}
    try:
        yield
    except user_errors():
        if resuming:
            for name, data in former.items():
                (folder / name).write_bytes(data)
        elif not (folder / runs.SCALARS).exists():  # not one iteration was made
            shutil.rmtree(folder, ignore_errors=True)
            with suppress(OSError):  # other runs are in it
                folder.parent.rmdir()
        raise


def describe(folder: Path, config: Any) -> None:
    """Write the settings and versions; those of a resumed run take the place of its former ones."""
    kept = dataclasses.replace(config, run=dataclasses.replace(config.run, resume=None))
    configuration.save(kept, folder)
    runs.write_json(folder / runs.VERSIONS, versions.describe(torch.get_num_threads()))


def _train(config: TrainConfig, env: HumanoidVectorEnv, folder: Path, resuming: bool, ranks: Ranks) -> int:
    kind = config.choices["agent"]
    base, origin = bases.adapted(config, env, folder if resuming else None)
    agent, generator = make_agent(kind, config.agent, env, config.seed, ranks, base)
    runner = Runner(
        env,
        agent,
        config.runner,
        generator,
        folder / runs.LAST,
        meta=checkpoint_meta(kind, config.agent, env, adapted=base is not None),
        logger=_logger(agent, env, folder) if ranks.first else None,
        ranks=ranks,
    )
    if resuming:
        runner.load(folder / runs.LAST)
    terms = dataclasses.asdict(terms_of(env.library.clips))
    # after loading: they are kept with a checkpoint, and need not be those here
    runner.meta |= {"terms": terms, **origin}
    if ranks.first:
        runs.write_json(folder / runs.TERMS, terms)
        runs.write_json(folder / runs.CLIPS, clip_digests(env.library.clips))
    what = kind if base is None else f"{kind} of {config.base}, adapted to {config.choices['to']},"
    count = len(env.library.clips)
    opening = f"{folder}: {what} on {count} clip{'s' * (count > 1)}, {launch.worlds(config, ranks)}"
    keep = () if config.run.keep_every is None else (Keeper(runner, agent, config.run.keep_every, folder),)

    def begin(progress: Progress) -> None:
        if not resuming:
            _warm_start(config, runner, generator, progress)

    with exactness(choose(config.matmul, env.device)):
        stopped = follow(runner, folder, opening, begin=begin, on_iteration=keep)
    if not ranks.first:
        return 0
    _keep_skills(agent, env, folder)
    if stopped:
        (folder / runs.MEASURES).unlink(missing_ok=True)  # of this run when it had ended before: no longer its figures
        report.write(folder)
        print(f"stopped at {runner.samples:,} samples; go on with: murmillo train run.resume={folder}")
        return 0
    with on(CPU):
        _finish(config, folder)
    return 0


def follow(
    runner: Runner,
    folder: Path,
    opening: str,
    *,
    metrics: tuple[Metric, ...] = TRAINING,
    begin: Callable[[Progress], None] = lambda progress: None,
    on_iteration: Sequence[Callable[[dict[str, float]], None]] = (),
) -> bool:
    """Run it to its end, or to a signal's, under a display of its progress; whether a signal ended it.

    Args:
        runner: its notices are kept in the run's `folder`, by the first rank; its logger is closed.
        folder: of the run.
        opening: the first line.
        metrics: that are shown.
        begin: called before the first iteration.
        on_iteration: called with every iteration's statistics.
    """
    limits = runner.config
    progress = make_progress(limits.samples, runner.samples, limits.max_minutes, metrics)
    with progress, stopping(runner.stop, progress) as stopped:
        progress.say(opening)
        begin(progress)
        begun = time.monotonic()
        runner.on_iteration = [
            lambda scalars: progress.show(int(scalars["samples"]), time.monotonic() - begun, scalars),
            *on_iteration,
        ]
        runner.on_warning = [lambda text: progress.say(f"warning: {text}")]
        runner.run()
    if runner.ranks.first:
        runs.write_json(folder / runs.NOTICES, [dataclasses.asdict(notice) for notice in runner.watch.notices])
    if runner.logger is not None:
        runner.logger.close()
    return runner.ranks.any(stopped())


def _logger(agent: Any, env: HumanoidVectorEnv, folder: Path) -> Logger:
    """Of an agent with labels, one that follows each skill."""
    return SkillLogger(folder, agent, env.skills) if isinstance(agent, Labelled) else Logger(folder)


def _keep_skills(agent: Any, env: HumanoidVectorEnv, folder: Path) -> None:
    """Write what an agent with labels knows of each skill."""
    if isinstance(agent, Labelled):
        tables = {name: figures.tolist() for name, figures in agent.skill_tables().items()}
        skills = [dict(zip(tables, figures, strict=True)) for figures in zip(*tables.values(), strict=True)]
        runs.write_json(folder / runs.SKILLS, dict(zip(env.skills, skills, strict=True)))


def _warm_start(config: TrainConfig, runner: Runner, generator: torch.Generator, progress: Progress) -> None:
    """Regress the policy on what leads along the clips, and keep what comes of it for the report."""
    if not (config.warm_start.steps or config.guided_start.rounds):
        return
    agent: Any = runner.agent
    env: Any = runner.env
    if config.warm_start.steps:
        progress.say(f"warm start: {config.warm_start.steps} steps on the clips' own next poses")
        losses = warm_start(
            agent.model, env.demonstrations.imitation_pairs, config.warm_start, generator, agent.draw_condition
        )
        progress.say(f"warm start: squared error of the action from {losses[0]:.4f} to {losses[-1]:.4f}")
    if rounds := config.guided_start.rounds:
        each = env.num_envs * config.guided_start.steps
        progress.say(f"guided start: {rounds} rounds of {each:,} control steps along the clips")
        made = guided_start(agent.model, env, config.guided_start, generator, agent.draw_condition)
        for number, round_ in enumerate(made, start=1):
            who = "policy" if number > 1 else "guide"
            length = f"{round_.length:.0f} steps" if math.isfinite(round_.length) else "the whole round"
            progress.say(
                f"guided start: round {number}, the {who} goes on for {length}, squared error {round_.loss:.5f}"
            )
    runner.ranks.copy_first(agent.model)  # all did the same, but not all processors round alike
    state = {"meta": runner.meta, "agent": agent.state_dict()}
    if runner.ranks.first:
        checkpoint.save(runner.checkpoint_folder.with_name(Path(runs.WARM_STARTED).name), state)


@contextmanager
def stopping(stop: Callable[[], None], progress: Progress) -> Iterator[Callable[[], bool]]:
    """SIGINT and SIGTERM end the run after the iteration under way; a second SIGINT breaks it off."""
    signals: list[int] = []

    def handle(number: int, frame: Any) -> None:
        if number in signals and number == signal.SIGINT:
            raise KeyboardInterrupt
        signals.append(number)
        stop()
        progress.say("stopping after this iteration; Ctrl-C again breaks off at once")

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(signals)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _finish(config: TrainConfig, folder: Path) -> None:
    """Measure the policy before and after training, film it, write the report."""
    print("measuring the policy before and after training", flush=True)
    runs.write_json(folder / runs.MEASURES, measure_ages(config, folder, config.run.measured_worlds))
    if config.run.evaluate:
        _evaluate(config, folder)
    if config.run.video:
        film(folder)
    print(f"the report: {report.write(folder)}")


def _evaluate(config: TrainConfig, folder: Path) -> None:
    """Put the policy beside the clips and the papers; who interrupts this keeps the run and can take it up again."""
    trajectories = config.run.measured_worlds
    print(f"measuring what the papers measure: {trajectories} trajectories; Ctrl-C leaves this out", flush=True)
    try:
        evaluate(config, folder, Request((QUICK,), trajectories))
    except KeyboardInterrupt:
        print(f"left out; go on with: murmillo evaluate run={folder} trajectories={trajectories}")


def film(folder: Path) -> None:
    """Record in a process of its own: no graphics driver can then harm the run. One line says why there is no film."""
    command = [sys.executable, "-m", "murmillo.cli.main", "record", f"run={folder}", f"seconds={FILM_S}"]
    done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    lines = done.stderr.strip().splitlines() or [f"recording ended with status {done.returncode}"]
    reason = lines[-1].removeprefix("murmillo: ")
    runs.write_json(folder / runs.FILMING, {"reason": None if done.returncode == 0 else reason})
    print(done.stdout.strip() if done.returncode == 0 else f"no video: {reason}")
