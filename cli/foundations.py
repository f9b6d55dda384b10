"""A run that another one is built on: found, and known again by its checkpoint."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

from murmillo.agents.common.base import Base
from murmillo.agents.common.checkpoint import META, TENSORS
from murmillo.agents.common.errors import AgentError
from murmillo.cli import runs
from murmillo.cli.config import TrainConfig
from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation.identity import checkpoint_digest
from murmillo.envs.character import Character

_ABSENT = "none"


@dataclass(frozen=True)
class Foundation:
    """A run that another one is built on.

    Attributes:
        word: as the user named it.
        folder: of the run.
    """

    word: str
    folder: Path

    def check_same(self, setting: str, group: str, config: Any, own: Any, names: Sequence[str]) -> None:
        """Refuse other values than those that its policy was made with.

        Args:
            setting: that names the run.
            group: of the settings that are looked at, `config`; the run's are `own`.
            names: of those that must agree, as far as there are such.

        Raises:
            CommandError: naming the first that does not.
        """
        for name in names:
            if not hasattr(own, name.partition(".")[0]):
                continue
            value, kept = attrgetter(name)(config), attrgetter(name)(own)
            if value != kept:
                raise CommandError(
                    f"{group}.{name}={written(value)}: the policy of {setting}={self.word} was trained with "
                    f"{written(kept)}; drop {group}.{name}, or name another run"
                )

    def policy(self, setting: str, character: Character) -> Base:
        """Its policy, without the outputs for joints that the character has not.

        Raises:
            CommandError: its checkpoint is damaged.
        """
        try:
            base = Base.load(self.folder / runs.LAST)
        except AgentError as error:
            raise CommandError(f"{setting}={self.word}: {error}") from None
        kept = [output for output in range(character.base.action_dim) if output not in character.pruned]
        return base.pruned(kept) if character.pruned else base


@dataclass(frozen=True)
class SkillRun(Foundation):
    """A run of ASE, CALM or C·ASE.

    Attributes:
        config: its settings.
    """

    config: TrainConfig

    @property
    def kind(self) -> str:
        """Its agent's name."""
        return self.config.choices["agent"]


def trained_run(word: str, setting: str) -> Path:
    """The folder of the run that a setting names.

    Raises:
        CommandError: there is no such run, or it has no checkpoint.
    """
    folder = runs.existing(word, setting)
    if not all((folder / runs.LAST / name).is_file() for name in (META, TENSORS)):
        raise CommandError(
            f"{setting}={word}: this run has no checkpoint; train it first: murmillo train run.resume={word}"
        )
    return folder


def identity(setting: str, folder: Path | None) -> dict[str, str]:
    """What a checkpoint keeps of the run that it was built on: where it was, and its digest."""
    if folder is None:
        return {}
    return {setting: str(folder), f"{setting}_digest": checkpoint_digest(folder / runs.LAST)}


def check_unchanged(setting: str, word: str, folder: Path | None, saved: Mapping[str, Any]) -> None:
    """Refuse another run than the one that a checkpoint was built on.

    Args:
        setting: that names the run, by `word`.
        folder: of what it names now.
        saved: content of the checkpoint.

    Raises:
        CommandError: their digests differ.
    """
    known = (saved.get("meta", {}), identity(setting, folder))
    then, now = (found.get(f"{setting}_digest") for found in known)
    if now != then:
        raise CommandError(
            f"{setting}={word}: its checkpoint is not the one that this policy was trained over (SHA-256 "
            f"{_short(then)} then, {_short(now)} now); name a copy of that one with {setting}=…, or train a new policy"
        )


def written(value: Any) -> str:
    """As on the command line."""
    return f"[{','.join(map(str, value))}]" if isinstance(value, tuple) else str(value)


def _short(digest: str | None) -> str:
    return _ABSENT if digest is None else digest[:12]
