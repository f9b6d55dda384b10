"""The settings of `murmillo train task=…`: those of the task, of the policy, and what the low-level run decides."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig, OmegaConf

from murmillo.agents.calm.precision import PrecisionConfig
from murmillo.agents.case.high_level import HybridConfig
from murmillo.agents.common.latent_env import LatentEnvConfig
from murmillo.agents.common.runner import RunnerConfig
from murmillo.cli.agents import AGENTS
from murmillo.cli.config import check_words, compose_words, merge, reading, resolved, resume, resumed_run
from murmillo.cli.errors import CommandError
from murmillo.cli.schema import build, twin_of
from murmillo.cli.tasks import low as low_runs
from murmillo.cli.tasks.low import NONE, SCRATCH, LowRun
from murmillo.cli.tasks.names import commands_skills, task_class, task_names
from murmillo.cli.tasks.words import value_of
from murmillo.envs import EnvConfig
from murmillo.envs.starts import StartConfig
from murmillo.envs.tasks import Task

FILES = "murmillo.conf.tasks"
RESUMABLE = ("run.", "runner.", "threads=", "low=")
"""What may be set anew when a run is taken up again; `low` to say where its low-level run has moved."""


@dataclass
class TaskRunConfig:
    """Where a run is kept.

    Attributes:
        root: folder of the runs.
        name: the run's folder in it; by default the time, the task, the agent, the budget and the seed.
        resume: folder of a run to take up again, with its own settings.
        measured_worlds: episodes that the policy is measured in at the end.
        video: film the trained character at the end.
    """

    root: str = "runs"
    name: str | None = None
    resume: str | None = None
    measured_worlds: int = 64
    video: bool = True


@dataclass
class TaskTrainConfig:
    """All settings of a run that learns a task.

    Attributes:
        task: the task's own arguments.
        low: folder of the run whose policy is followed, or "none".
        agent: the policy that is trained.
        latent_env: its decisions, where there is a policy below.
        precision: the styles of CALM's precision training.
        env: the low-level run's environment, but begun standing.
        choices: the task, the agent below ("scratch" where there is none) and the budget.
        num_envs: worlds that are simulated together.
        seed: of everything random.
        threads: CPU threads; 0 takes every core that the process may use.
    """

    task: Any
    low: str
    agent: HybridConfig = field(default_factory=HybridConfig)
    latent_env: LatentEnvConfig = field(default_factory=LatentEnvConfig)
    precision: PrecisionConfig = field(default_factory=PrecisionConfig)
    env: EnvConfig = field(default_factory=EnvConfig)
    runner: RunnerConfig = field(default_factory=lambda: RunnerConfig(reward_weights={"task": 1.0}))
    run: TaskRunConfig = field(default_factory=TaskRunConfig)
    choices: dict[str, str] = field(default_factory=dict)
    num_envs: int = 4096
    seed: int = 1
    threads: int = 0

    def make_task(self) -> Task:
        """The task with its arguments. Raises SuiteError where one cannot be."""
        cls: Any = task_class(self.choices["task"])
        return cls(self.task)

    @property
    def commands_styles(self) -> bool:
        """CALM's precision training: the task commands skills, and the latents are to lie near their encodings."""
        return _is_precision(self.choices["task"], self.choices["agent"])


def compose_task(words: list[str]) -> TaskTrainConfig:
    """The settings that these words of the command line ask for.

    Raises:
        CommandError: a word that cannot be, in one line with what would be right.
    """
    check_words(words)
    if (resumed := resumed_run(words)) is not None:
        return resume(resumed, words, load, RESUMABLE)
    name, low = value_of(words, "task"), value_of(words, "low")
    if name is None:
        raise CommandError(f"low={low}: which task is to be learned over it? write task=…: {', '.join(task_names())}")
    task_class(name)
    if low is None:
        raise CommandError(
            f"task={name}: over which policy? write low=runs/<name>, a run of `murmillo train`, or low=none for a "
            "policy that acts itself"
        )
    below = low_runs.find(low)
    kind = SCRATCH if below is None else below.kind
    composed, choices = _compose(name, kind, below, [w for w in words if not w.lstrip("+").startswith("task=")])
    config = _typed(composed, {"task": name, "agent": kind, "budget": choices["budget"]})
    config.agent.skill = config.agent.skill or config.commands_styles or _is_told_labels(config)
    return config


def load(folder: Path, words: list[str] | None = None) -> TaskTrainConfig:
    """The settings of a run, with those of `words` (name=value) laid over them.

    Raises:
        CommandError: the file is no configuration of this version.
    """
    with reading(folder) as (saved, choices):
        if choices.get("agent") not in (*AGENTS, SCRATCH) or choices.get("task") not in task_names():
            raise CommandError("choices: names no task or no agent that there is; copy the file of the run anew")
        known = OmegaConf.structured(twin_of(_defaults(choices["task"], None)))
        return _typed(merge(known, saved, words or []), choices)


def _is_told_labels(config: TaskTrainConfig) -> bool:
    """C·ASE's user-controlled policies: the label comes from outside, and the policy learns the latent for it."""
    return config.choices["agent"] == "case" and config.make_task().skill_steps > 0


def _is_precision(task: str, kind: str) -> bool:
    return kind == "calm" and commands_skills(task)


def _compose(task: str, kind: str, below: LowRun | None, words: list[str]) -> tuple[DictConfig, Mapping[str, Any]]:
    """Hydra's configuration and choices; the agent is of the low-level run's kind."""
    asked = value_of(words, "agent")
    if asked is not None and asked != kind:
        has = "there is no policy below to be of a kind" if below is None else f"low={below.word} is a run of {kind}"
        raise CommandError(f"agent={asked}: {has}; write agent={kind}, or leave it out")
    ConfigStore.instance().store(name="task_schema", node=twin_of(_defaults(task, below)))
    file = f"{kind}_precision" if _is_precision(task, kind) else kind
    return compose_words([*words, f"agent={file}"], FILES)


def _defaults(task: str, below: LowRun | None) -> TaskTrainConfig:
    """What holds where nothing is said: a task's own defaults, and the environment of the low-level run."""
    arguments: Any = task_class(task).config_type
    env = EnvConfig() if below is None else below.config.env
    # the published tasks begin standing, with ASE's clock, whatever the low-level policy has practised
    standing = dataclasses.replace(
        env, episode_steps=EnvConfig.episode_steps, starts=StartConfig(recovery=0.0, fallen=0.0, reference=0.0)
    )
    return TaskTrainConfig(arguments(), NONE if below is None else below.word, env=standing)


def _typed(composed: DictConfig, choices: Mapping[str, Any]) -> TaskTrainConfig:
    chosen = {str(group): str(choice) for group, choice in choices.items()}
    arguments: Any = task_class(chosen["task"]).config_type
    values = resolved(composed)
    values["task"] = build(arguments, values["task"], "task.")
    return build(TaskTrainConfig, {**values, "choices": chosen})
