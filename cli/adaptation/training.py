"""One run of AdaptNet from its settings to its report: build, train, measure, film, report."""

import dataclasses
from pathlib import Path

import torch

from murmillo.agents.adaptnet.agent import AdaptNet
from murmillo.agents.adaptnet.networks import LENGTH
from murmillo.agents.common import checkpoint
from murmillo.agents.common.interface import Obs
from murmillo.agents.common.logger import Logger
from murmillo.agents.common.rollout import tensors
from murmillo.agents.common.runner import Runner
from murmillo.agents.common.warm_start import warm_start
from murmillo.cli import foundations, runs, versions
from murmillo.cli.adaptation import report
from murmillo.cli.adaptation.base import SETTING, BaseRun
from murmillo.cli.adaptation.checks import check_settings
from murmillo.cli.adaptation.config import AdaptNetTrainConfig
from murmillo.cli.adaptation.evaluating import evaluate
from murmillo.cli.adaptation.metrics import TRAINING
from murmillo.cli.adaptation.world import agent_meta, check_base, make_agent, make_env
from murmillo.cli.devices import CPU
from murmillo.cli.evaluation.identity import clip_digests
from murmillo.cli.progress import Progress
from murmillo.cli.tasks import table
from murmillo.cli.training import describe, film, follow, undone_by_mistakes
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.devices import on
from murmillo.envs.motion.licences import terms_of


def train(config: AdaptNetTrainConfig, suffix: str = "") -> int:
    """Train as the settings say; 0 also where a signal ended it early. `suffix` is put behind a default name.

    Raises:
        CommandError, SuiteError, AgentError: a mistake in the settings; a new run's folder is then not left behind.
    """
    base = config.find_base()
    check_settings(config, base)
    resuming = config.run.resume is not None
    name = config.run.name or runs.default_name(_named(config), config.choices["budget"], config.seed, suffix)
    folder = Path(config.run.resume) if config.run.resume else runs.vacant(config.run.root, name)
    config.run.name = name
    if resuming:
        check_base(base, checkpoint.load(folder / runs.LAST))
    torch.set_num_threads(config.threads or versions.usable_cores())
    env = make_env(config, config.num_envs, training=True)
    try:
        if not resuming:
            runs.make(folder)
        with undone_by_mistakes(folder, resuming), on(env.device):
            describe(folder, config)
            return _train(config, base, env, folder, resuming)
    finally:
        env.close()


def _named(config: AdaptNetTrainConfig) -> str:
    """What the run is called by: adaptnet-base, or adaptnet-style with its method."""
    choices = config.choices
    if config.stage == "base":
        return f"{choices['agent']}-{config.stage}"
    return f"{choices['method']}-{choices['to']}"


def _train(
    config: AdaptNetTrainConfig, base: BaseRun | None, env: HumanoidVectorEnv, folder: Path, resuming: bool
) -> int:
    agent, generator = make_agent(config, base, env)
    meta = agent_meta(config, env)
    runner = Runner(env, agent, config.runner, generator, folder / runs.LAST, meta=meta, logger=Logger(folder))
    if resuming:
        runner.load(folder / runs.LAST)
    # after loading: they are kept with a checkpoint, and need not be those here
    terms = dataclasses.asdict(terms_of(env.library.clips))
    runner.meta |= {"terms": terms, **foundations.identity(SETTING, base and base.folder)}
    runs.write_json(folder / runs.TERMS, terms)
    runs.write_json(folder / runs.CLIPS, clip_digests(env.library.clips))
    what = "a base" if base is None else f"{base.word} to {config.choices['to']} by {config.choices['method']}"

    def begin(progress: Progress) -> None:
        if not resuming and config.warm_start.steps:
            _warm_start(config, agent, env, generator, progress)

    if follow(runner, folder, f"{folder}: {what}, {config.num_envs} worlds", metrics=TRAINING, begin=begin):
        for name in (runs.MEASURES, runs.METRICS):  # of this run when it had ended before: no longer its figures
            (folder / name).unlink(missing_ok=True)
        report.write(folder)
        print(f"stopped at {runner.samples:,} samples; go on with: murmillo train run.resume={folder}")
        return 0
    with on(CPU):
        _finish(config, base, folder)
    return 0


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

    def told(n: int) -> Obs:
        return {name: obs[name][torch.randint(env.num_envs, (n,), generator=generator)] for name in agent.observed.told}

    progress.say(f"warm start: {config.warm_start.steps} steps on the clips' own next poses")
    losses = warm_start(agent.model, env.demonstrations.imitation_pairs, config.warm_start, generator, told)
    progress.say(f"warm start: squared error of the action from {losses[0]:.4f} to {losses[-1]:.4f}")


def _finish(config: AdaptNetTrainConfig, base: BaseRun | None, folder: Path) -> None:
    """Measure the policy beside the one that training began with, film it, write the report."""
    print("measuring the policy before and after training", flush=True)
    results = evaluate(config, base, folder, config.run.measured_worlds)
    runs.write_json(folder / runs.MEASURES, table.by_player(results))
    if config.run.video:
        film(folder)
    print(f"the report: {report.write(folder)}")
