"""alpha=… and with=…: how much of an adaptation acts, and beside which other one; of every method and command alike."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from murmillo.cli.errors import CommandError

if TYPE_CHECKING:
    from murmillo.cli.config import TrainConfig
    from murmillo.envs import HumanoidVectorEnv

FOLDER = "blends"
"""Of what is measured of blends, in the folder of the run."""


@dataclass(frozen=True)
class Blend:
    """What a command was told of adapters.

    Attributes:
        alpha: how much of the run's adapter acts, in [0, 1]; None is all of it, or half of each of two.
        other: folder of another adaptation of the same base, of which 1 - alpha acts; None for none.
    """

    alpha: float | None = None
    other: str | None = None

    def __post_init__(self) -> None:
        if self.alpha is not None and not 0.0 <= self.alpha <= 1.0:  # so written, a NaN is refused too
            raise CommandError(
                f"alpha={self.alpha:g}: 0 is without the adapter, 1 with all of it; name a number between"
            )

    def __bool__(self) -> bool:
        """Whether anything was told."""
        return self.alpha is not None or self.other is not None

    def __str__(self) -> str:
        """As on the command line."""
        said = {"alpha": None if self.alpha is None else f"{self.alpha:g}", "with": self.other}
        return " ".join(f"{name}={value}" for name, value in said.items() if value is not None)

    def place(self, folder: Path) -> Path:
        """Where figures of it are kept: in a folder of its own within the run's, or in that where nothing was told."""
        if not self:
            return folder
        other = None if self.other is None else Path(self.other).name
        return folder / FOLDER / str(Blend(self.alpha, other)).replace(" ", ",")

    def identity(self) -> dict[str, Any]:
        """What figures of it depend on beside the run's checkpoint; nothing where nothing was told."""
        from murmillo.cli.evaluation.identity import checkpoint_digest
        from murmillo.cli.runs import LAST

        if not self:
            return {}
        with_digest = None if self.other is None else checkpoint_digest(Path(self.other) / LAST)
        return {"blend": {"alpha": self.alpha, "with": self.other, "with_checkpoint": with_digest}}

    def of(self, player: Any, kind: str, load: Callable[[Path], Any]) -> Any:
        """Let the adapters of a player act as was told, and return it.

        Args:
            player: that was loaded from the run, in its world.
            kind: its agent's name.
            load: gives the player of another run of that kind, in the same world.

        Raises:
            CommandError: the other run cannot be read or is of another kind, or the two do not go together.
        """
        from murmillo.agents.common.errors import AgentError
        from murmillo.cli import runs

        if self.other is not None:
            theirs = runs.existing(self.other, "with")
            _check_kind(self.other, kind)
            try:
                player.join(load(theirs))
            except AgentError as error:
                raise CommandError(f"with={self.other}: {error}") from None
        if self.alpha is not None:
            try:
                player.blend(self.alpha)
            except AgentError as error:
                raise CommandError(f"alpha={self.alpha:g}: {error}") from None
        return player


NOTHING = Blend()


def renamed(words: list[str]) -> list[str]:
    """Words name=value with `other` in place of `with`, which no field can be called."""
    return [f"other={word[len('with=') :]}" if word.startswith("with=") else word for word in words]


def load_blended(config: "TrainConfig", env: "HumanoidVectorEnv", checkpoint: Path, blend: Blend) -> Any:
    """The agent of a checkpoint of ASE, CALM or C·ASE to play in `env`, with its adapters as was told.

    Raises:
        AgentError: the checkpoint is damaged, or another character's or agent's.
        CommandError: what was told cannot be.
    """
    from murmillo.cli import config as configuration
    from murmillo.cli.agents import load_player
    from murmillo.cli.runs import LAST

    kind = config.choices["agent"]

    def load(theirs: Path) -> Any:
        other = configuration.load(theirs)
        return load_player(kind, other.agent, env, other.seed, theirs / LAST)

    return blend.of(load_player(kind, config.agent, env, config.seed, checkpoint), kind, load)


def _check_kind(word: str, kind: str) -> None:
    """Refuse a run of another method than `kind`. Raises CommandError."""
    from murmillo.cli.tasks.words import choices_of

    choices = choices_of(word)
    if "task" in choices:
        raise CommandError(f"with={word}: this run has learned a task; name another adaptation of the same base")
    if (theirs := choices.get("agent")) != kind:
        raise CommandError(f"with={word}: this is a run of {theirs}, the other one of {kind}; two must be of one base")
