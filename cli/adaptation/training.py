"""One run of AdaptNet from its settings to its report: build, train, measure, film, report."""

from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from murmillo.agents.adaptnet.agent import AdaptNet
from murmillo.agents.adaptnet.networks import LENGTH
from murmillo.agents.common import checkpoint
from murmillo.agents.common.interface import Obs
from murmillo.agents.common.logger import Logger
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.agents.common.rollout import tensors
from murmillo.agents.common.runner import Runner
from murmillo.agents.common.warm_start import warm_start
from murmillo.cli import foundations, launch, runs
from murmillo.cli.adaptation import report
from murmillo.cli.adaptation.base import SETTING, BaseRun
from murmillo.cli.adaptation.checks import check_settings
from murmillo.cli.adaptation.config import AdaptNetTrainConfig
from murmillo.cli.adaptation.evaluating import evaluate
from murmillo.cli.adaptation.metrics import TRAINING
from murmillo.cli.adaptation.world import agent_meta, check_base, make_agent, make_env
from murmillo.cli.devices import CPU
from murmillo.cli.progress import Progress
from murmillo.cli.tasks.training import complete, note_clips
from murmillo.cli.training import follow, kept
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.devices import on


def train(config: AdaptNetTrainConfig, suffix: str = "", ranks: Ranks = ALONE) -> int:
    """Train as the settings say; 0 also where a signal ended it early. `suffix` is put behind a default name.

    Ranks that share the run all call this; the first one writes, and measures in the end.

    Raises:
        CommandError, SuiteError, AgentError: a mistake in the settings; a new run's folder is then not left behind.
    """
    base = config.find_base()

    def check() -> AdaptNetTrainConfig:
        check_settings(config, base)
        return config

    launch.agreed(ranks, check)
    name = config.run.name or runs.default_name(_named(config), config.choices["budget"], config.seed, suffix)
    folder, resuming = launch.open_run(config, name, ranks)
    if resuming:
        check_base(base, checkpoint.load(folder / runs.LAST))
    threads = launch.share_threads(config).threads
    env = make_env(config, config.num_envs // ranks.size, threads=threads, training=True)
    try:
        with kept(folder, config, resuming, ranks), on(env.device):
            return _train(config, base, env, folder, resuming, ranks)
    finally:
        env.close()


def _named(config: AdaptNetTrainConfig) -> str:
    """What the run is called by: adaptnet-base, or adaptnet-style with its method."""
    choices = config.choices
    if config.stage == "base":
        return f"{choices['agent']}-{config.stage}"
    return f"{choices['method']}-{choices['to']}"


def _train(
    config: AdaptNetTrainConfig,
    base: BaseRun | None,
    env: HumanoidVectorEnv,
    folder: Path,
    resuming: bool,
    ranks: Ranks,
) -> int:
    agent, generator = make_agent(config, base, env, ranks)
    meta, logger = agent_meta(config, env), Logger(folder) if ranks.first else None
    to = folder / runs.LAST
    runner = Runner(env, agent, config.runner, generator, to, meta=meta, logger=logger, ranks=ranks)
    if resuming:
        runner.load(folder / runs.LAST)
    # after loading: they are kept with a checkpoint, and need not be those here
    runner.meta |= foundations.identity(SETTING, base and base.folder)
    note_clips(folder, runner, env, ranks)
    what = "a base" if base is None else f"{base.word} to {config.choices['to']} by {config.choices['method']}"

    def begin(progress: Progress) -> None:
        if not resuming and config.warm_start.steps:
            _warm_start(config, agent, env, generator, progress)
            ranks.copy_first(agent.model)

    def measured() -> dict[str, Any]:
        return evaluate(config, base, folder, config.run.measured_worlds)

    opening = f"{folder}: {what}, {launch.worlds(config, ranks)}"
    stopped = follow(runner, folder, opening, metrics=TRAINING, begin=begin)
    if not ranks.first:
        return 0
    with on(CPU):
        return complete(folder, runner.samples if stopped else None, measured, report.write, video=config.run.video)


def _warm_start(
    config: AdaptNetTrainConfig,
    agent: AdaptNet,
    env: HumanoidVectorEnv,
    generator: torch.Generator,
    progress: Progress,
) -> None:
    """Regress the policy on the clips' own next poses, under goals that have nothing to do with them."""
    obs = tensors(env.reset(seed=config.seed)[0])
    obs[LENGTH] = obs[LENGTH].new_full((env.num_envs,), agent.observed.frames or 1)  # pairs are moments within a clip

    def told(label: Tensor) -> Obs:
        rows = [torch.randint(env.num_envs, (len(label),), generator=generator) for _ in agent.observed.told]
        return {name: obs[name][some] for name, some in zip(agent.observed.told, rows, strict=True)}

    progress.say(f"warm start: {config.warm_start.steps} steps on the clips' own next poses")
    losses = warm_start(agent.model, env.demonstrations.imitation_pairs, config.warm_start, generator, told)
    progress.say(f"warm start: squared error of the action from {losses[0]:.4f} to {losses[-1]:.4f}")
