"""`murmillo train base=… to=…` of ASE, CALM and C·ASE: the run that is adapted, and the settings that are its own."""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from murmillo.agents.common import checkpoint
from murmillo.agents.common.base import Base
from murmillo.agents.common.errors import AgentError
from murmillo.cli import config as configuration
from murmillo.cli import foundations, runs
from murmillo.cli.adaptation.words import AGENT, is_adaptnet_run
from murmillo.cli.agents import checkpoint_meta
from murmillo.cli.config import TrainConfig
from murmillo.cli.errors import CommandError, near_names
from murmillo.cli.foundations import SkillRun
from murmillo.cli.tasks.words import is_task_run, value_of
from murmillo.envs import HumanoidVectorEnv

SETTING = "base"
TARGETS = ("friction", "terrain", "body", "pushes")
"""What a policy under latents or labels can be adapted to: another world, in which they mean the same."""
_FILES = "murmillo.conf.adaptnet"
_ENV = ("character", "features", "window", "residual_force", "residual_reward")
"""Settings of the environment that the base's policy, encoder and discriminator were made for."""
_AGENT = (
    "window",
    "latent_dim",
    "label_dim",
    "skill_discovery",
    "shared_trunk",
    "encoder_hidden",
    "encoder.frames",
    "encoder.stride",
    "encoder.hidden",
    "discriminator.hidden",
    "ppo.hidden",
    "ppo.style_hidden",
    "ppo.std",
    "ppo.std_learning_rate",
)
"""Settings of the agents that are a part of what is taken over."""
_FIXED = ("budget", "ablation")
"""Groups whose files were put into the base's settings already."""


class SkillBase(SkillRun):
    """A run of ASE, CALM or C·ASE from nothing: one that adapts no other."""


def find(word: str) -> SkillBase:
    """The run that `base=word` names.

    Raises:
        CommandError: there is no such run, it has no checkpoint, or it is no base.
    """
    if is_task_run(word):
        raise CommandError(f"base={word}: this run has learned a task; name a run of ase, calm or case")
    if is_adaptnet_run(word):
        raise CommandError(
            f"base={word}: this is a run of agent={AGENT}; write agent={AGENT} stage=adapt, or name a run of ase, calm "
            "or case"
        )
    folder = foundations.trained_run(word, SETTING)
    config = configuration.load(folder)
    if config.base is not None:
        raise CommandError(f"base={word}: this run adapts a policy itself; name the run that it adapts, {config.base}")
    return SkillBase(word, folder, config)


def compose_adaptation(words: list[str]) -> TrainConfig:
    """The settings that these words of the command line ask for; what they do not say is the base's.

    Raises:
        CommandError: a word that cannot be, in one line with what would be right.
    """
    configuration.check_words(words)
    words = [word.lstrip("+") for word in words]
    base, to = _chosen(words)
    said = [word for word in words if word.partition("=")[0] not in ("agent", "to", "task")]
    # who names other motions means all of them, not those clips that are called like the former ones
    begun = ["clips=[]"] if value_of(words, "motions") is not None else []
    begun += ["warm_start.steps=0", "guided_start.rounds=0"]
    if hasattr(base.config.agent, "upright_iterations"):
        begun.append("agent.upright_iterations=0")  # the base has come to the end of this curriculum
    with configuration.reading(base.folder) as (saved, choices):
        composed, _ = configuration.compose_words([f"agent={base.kind}"])
        del saved["run"]
        _link(saved, composed)
        target = OmegaConf.load(str(files(_FILES).joinpath("to", f"{to}.yaml")))
        chosen = {**{group: choices[group] for group in choices}, "to": to}
    merged = configuration.merge(composed, OmegaConf.merge(saved, target), [*begun, *said])
    return configuration.typed(merged, chosen)


def _chosen(words: Sequence[str]) -> tuple[SkillBase, str]:
    """The base, and what it is adapted to.

    Raises:
        CommandError: one is missing or cannot be, or a word does not go with them.
    """
    named, to = value_of(words, SETTING), value_of(words, "to")
    known = ", ".join(TARGETS)
    if named in (None, "null", ""):
        raise CommandError(f"to={to}: of which policy? write base=runs/<name>, a run of agent=ase, calm or case")
    if to in (None, ""):
        raise CommandError(f"base={named}: adapted to what? write to=…: {known}")
    base = find(str(named))
    if to not in TARGETS:
        raise CommandError(
            f"to={to}: a policy of {base.kind} cannot be adapted to that; {near_names(str(to), list(TARGETS))}"
        )
    if (agent := value_of(words, "agent")) not in (None, base.kind):
        raise CommandError(
            f"agent={agent}: base={named} is a run of {base.kind}; write agent={base.kind}, or leave it out"
        )
    for group in _FIXED:
        if (value := value_of(words, group)) is not None:
            raise CommandError(
                f"{group}={value}: the settings of an adaptation are its base's; drop this, and write what is to "
                "differ, such as runner.samples=200_000"
            )
    return base, str(to)


def _link(saved: DictConfig, composed: DictConfig) -> None:
    """Let those settings of the environment follow from others again which did so in the base."""
    for name, written in OmegaConf.to_container(composed.env, resolve=False).items():  # type: ignore[union-attr]
        if isinstance(written, str) and written.startswith("${"):
            source = OmegaConf.select(saved, written[2:-1])
            if name in saved.env and saved.env[name] == source:
                del saved.env[name]


def check(config: TrainConfig) -> None:
    """Refuse what an adaptation cannot change of its base; settings without a base pass.

    Raises:
        CommandError: naming the setting, what was wrong and what would be right.
    """
    if config.base is None:
        return
    base = find(config.base)
    starts = {"warm_start.steps": config.warm_start.steps, "guided_start.rounds": config.guided_start.rounds}
    for name, number in starts.items():
        if number:
            raise CommandError(f"{name}={number}: an adaptation begins with what its base can do; drop this")
    base.check_same(SETTING, "agent", config.agent, base.config.agent, _AGENT)
    base.check_same(SETTING, "env", config.env, base.config.env, _ENV)


def adapted(
    config: TrainConfig, env: HumanoidVectorEnv, folder: Path | None = None
) -> tuple[Base | None, dict[str, Any]]:
    """The policy that a run adapts, None where it begins with nothing, and what its checkpoint keeps of where it was.

    Args:
        config: of the run.
        env: in which it acts.
        folder: of a run that is taken up again, whose checkpoint has all of that; None for a new one.

    Raises:
        CommandError: the base's checkpoint is damaged, or made with other clips or another character.
        AgentError: that of the folder is.
    """
    if config.base is None:
        return None, {}
    if folder is not None:
        saved = checkpoint.load(folder / runs.LAST)
        origin = {name: saved["meta"][name] for name in (SETTING, f"{SETTING}_digest")}
        return Base.within(saved["agent"]), origin
    base = find(config.base)
    policy = base.policy(SETTING, env.character)
    here = checkpoint_meta(base.kind, config.agent, env)
    del here["action_dim"]  # joints may be locked
    try:
        checkpoint.check_compatible(checkpoint.load(base.folder / runs.LAST)["meta"], here)
    except AgentError as error:
        raise CommandError(f"base={base.word}: {error}; keep its clips and its character") from None
    return policy, foundations.identity(SETTING, base.folder)
