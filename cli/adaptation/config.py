"""The settings of `murmillo train agent=adaptnet`, for base policies and for adaptations, which begin with a base's."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig, OmegaConf

from murmillo.agents.adaptnet.config import AdaptNetConfig
from murmillo.agents.common.runner import RunnerConfig
from murmillo.agents.common.warm_start import WarmStartConfig
from murmillo.cli.adaptation import base as base_runs
from murmillo.cli.adaptation.base import BaseRun
from murmillo.cli.adaptation.words import AGENT
from murmillo.cli.config import check_words, compose_words, merge, reading, resolved, resume, resumed_run
from murmillo.cli.errors import CommandError, near_names
from murmillo.cli.runs import MERGED
from murmillo.cli.schema import build, twin_of
from murmillo.cli.tasks.config import TaskRunConfig
from murmillo.cli.tasks.words import value_of
from murmillo.envs import EnvConfig
from murmillo.envs.registration import env_config
from murmillo.envs.tasks.navigate import Navigate, NavigateConfig

FILES = "murmillo.conf.adaptnet"
GROUPS = ("method", "to", "budget", "ablation")
RESUMABLE = ("run.", "runner.", "threads=", "base=")
"""What may be set anew when a run is taken up again; `base` to say where its base has moved."""
SCRATCH = "scratch"
"""The method that takes nothing but the settings from the base."""
TARGETS = ("style", "body", "lock", "friction", "terrain", "obstacles", "pushes")
"""What a policy can be adapted to, the files of `conf/adaptnet/to`."""

Stage = Literal["base", "adapt"]


@dataclass
class AdaptNetTrainConfig:
    """All settings of a run.

    Attributes:
        stage: "base" trains a policy from nothing, "adapt" changes that of another run.
        base: folder of that other run.
        agent: its configuration.
        task: arguments of `Navigate`, which all policies learn.
        env: in an adaptation, what is not said is the base's.
        warm_start: of a base; an adaptation begins with what its base can do.
        choices: "adaptnet", the stage, and the files of `conf/adaptnet` that this was put together from, by group.
        motions: "builtin", a folder of clips or one file: the style.
        clips: names of those of them that are learned, or patterns such as "walk_*"; empty for all.
        num_envs: worlds that are simulated together.
        seed: of everything random.
        threads: CPU threads; 0 takes every core that the process may use.
    """

    stage: Stage = "base"
    base: str | None = None
    agent: AdaptNetConfig = field(default_factory=AdaptNetConfig)
    task: NavigateConfig = field(default_factory=NavigateConfig)
    env: EnvConfig = field(default_factory=lambda: env_config("Navigate"))
    runner: RunnerConfig = field(
        default_factory=lambda: RunnerConfig(
            horizon=8,
            gamma=0.95,
            lam=0.95,
            reward_weights={"task": 0.5, "imitation": 0.5},
            termination_reward=-25.0,
        )
    )
    warm_start: WarmStartConfig = field(default_factory=WarmStartConfig)
    run: TaskRunConfig = field(default_factory=TaskRunConfig)
    choices: dict[str, str] = field(default_factory=dict)
    motions: str = "builtin"
    clips: tuple[str, ...] = ()
    num_envs: int = 512
    seed: int = 1
    threads: int = 0

    def make_task(self) -> Navigate:
        """The task with its arguments. Raises SuiteError where one cannot be."""
        return Navigate(self.task)

    def find_base(self) -> BaseRun | None:
        """The run that is adapted; None where there is none, or it was merged.

        Raises CommandError where it is missing or no base.
        """
        return None if self.base is None or MERGED in self.choices else base_runs.find(self.base)


def compose_adaptnet(words: list[str]) -> AdaptNetTrainConfig:
    """The settings that these words of the command line ask for.

    Raises:
        CommandError: a word that cannot be, in one line with what would be right.
    """
    check_words(words)
    if (resumed := resumed_run(words)) is not None:
        return resume(resumed, words, load, RESUMABLE)
    words = [word for word in words if not word.lstrip("+").startswith("agent=")]
    base = _find_base(words)
    # who names other motions means all of them, not those clips that are called like the former ones
    everything = [] if value_of(words, "motions") is None else ["clips=[]"]
    # these settings of a budget are for bases; an adaptation has those of its own base
    kept = [] if base is None else [*base.sizes(), f"task.turn={base.config.task.turn}", "warm_start.steps=0"]
    return _compose(base, [*everything, *kept, *words])


def load(folder: Path, words: list[str] | None = None) -> AdaptNetTrainConfig:
    """The settings of a run, with those of `words` (name=value) laid over them.

    Raises:
        CommandError: the file is no configuration of this version.
    """
    with reading(folder) as (saved, choices):
        if choices.get("agent") != AGENT or choices.get("stage") not in get_args(Stage):
            raise CommandError(f"choices: this is no run of agent={AGENT}; copy the file of the run anew")
        known = OmegaConf.structured(twin_of(AdaptNetTrainConfig()))
        return _typed(merge(known, saved, words or []), choices)


def _find_base(words: list[str]) -> BaseRun | None:
    """The run that the words name to be adapted; None for a base.

    Raises:
        CommandError: the stage and what is said beside it do not go together.
    """
    stage, named, to = (value_of(words, name) for name in ("stage", "base", "to"))
    if stage not in (None, *get_args(Stage)):
        raise CommandError(f"stage={stage}: there is no such stage; {near_names(str(stage), list(get_args(Stage)))}")
    if stage != "adapt":
        for name in ("base", "to", "method", "ablation"):
            if (value := value_of(words, name)) is not None:
                raise CommandError(f"{name}={value}: a base is trained from nothing; add stage=adapt, or drop {name}=…")
        return None
    if named in (None, "null", ""):
        raise CommandError(
            "stage=adapt: which policy? write base=runs/<name>, a run of murmillo train agent=adaptnet stage=base"
        )
    if to not in TARGETS:
        asked = "stage=adapt: to what?" if to is None else f"to={to}: there is no such choice;"
        raise CommandError(f"{asked} write to=…: {', '.join(TARGETS)}")
    return base_runs.find(str(named))


def _compose(base: BaseRun | None, words: list[str]) -> AdaptNetTrainConfig:
    ConfigStore.instance().store(name="adaptnet_schema", node=twin_of(_defaults(base)))
    composed, choices = compose_words(words, FILES)
    chosen = {group: str(choices[group]) for group in GROUPS}
    return _typed(composed, {"agent": AGENT, "stage": "base" if base is None else "adapt", **chosen})


def _defaults(base: BaseRun | None) -> AdaptNetTrainConfig:
    """What holds where nothing is said: in an adaptation, the world of the base."""
    if base is None:
        return AdaptNetTrainConfig()
    own = base.config
    return dataclasses.replace(AdaptNetTrainConfig(), env=own.env, task=own.task, motions=own.motions, clips=own.clips)


def _typed(composed: DictConfig, choices: Mapping[str, Any]) -> AdaptNetTrainConfig:
    chosen = {str(group): str(choice) for group, choice in choices.items()}
    return build(AdaptNetTrainConfig, {**resolved(composed), "choices": chosen})
