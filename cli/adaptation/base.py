"""The run whose policy is adapted: found, checked, and known again by its checkpoint."""

from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING

from murmillo.agents.adaptnet.config import AdaptNetConfig
from murmillo.cli import foundations, runs
from murmillo.cli.adaptation.words import AGENT, is_adaptnet_run
from murmillo.cli.errors import CommandError
from murmillo.cli.foundations import Foundation, written
from murmillo.cli.tasks.words import choices_of
from murmillo.envs import EnvConfig

if TYPE_CHECKING:
    from murmillo.cli.adaptation.config import AdaptNetTrainConfig

SETTING = "base"
_SIZES = ("recurrent", "ppo.hidden")
"""Settings of the agent that its policy was made with."""


@dataclass(frozen=True)
class BaseRun(Foundation):
    """A run of `stage=base`.

    Attributes:
        config: its settings.
    """

    config: "AdaptNetTrainConfig"

    def check_env(self, env: EnvConfig) -> None:
        """Refuse another character; its body may be another one.

        Raises:
            CommandError: naming the setting.
        """
        self.check_same(SETTING, "env", env, self.config.env, ("character",))

    def sizes(self) -> list[str]:
        """Its policy's sizes as words `name=value`, since an adaptation has the same."""
        return [f"agent.{name}={written(attrgetter(name)(self.config.agent))}" for name in _SIZES]

    def check_sizes(self, agent: AdaptNetConfig) -> None:
        """Refuse a policy of another size.

        Raises:
            CommandError: naming the setting.
        """
        self.check_same(SETTING, "agent", agent, self.config.agent, _SIZES)


def find(word: str) -> BaseRun:
    """The run that `base=word` names.

    Raises:
        CommandError: there is no such run, it has no checkpoint, or it is no base.
    """
    from murmillo.cli.adaptation.config import load  # whose settings know what a base is

    folder = runs.existing(word, SETTING)
    if not is_adaptnet_run(word):
        raise CommandError(f"base={word}: this is no run of agent={AGENT}; name one of agent={AGENT} stage=base")
    if choices_of(word).get("stage") != "base":
        raise CommandError(f"base={word}: this run adapts a policy itself; name the run of stage=base that it adapts")
    return BaseRun(word, foundations.trained_run(word, SETTING), load(folder))
