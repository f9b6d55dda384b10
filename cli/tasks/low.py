"""The low-level run beneath a high-level policy: found, checked, and known again by its checkpoint."""

from pathlib import Path
from typing import Any

from murmillo.agents.common.errors import AgentError
from murmillo.cli import config as configuration
from murmillo.cli import foundations, runs
from murmillo.cli.adaptation.words import is_adaptnet_run
from murmillo.cli.agents import load_player
from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation.identity import checkpoint_digest
from murmillo.cli.foundations import SkillRun
from murmillo.cli.tasks.words import is_task_run
from murmillo.envs import EnvConfig, HumanoidVectorEnv
from murmillo.envs.terrain import is_uneven

NONE = "none"
"""`low=none`: the policy acts itself, on the character's own action."""
SCRATCH = "scratch"
"""What ASE calls such a policy, and its name among the agents."""

_SETTING = "low"
_ITS_OWN = ("character", "window", "residual_force", "residual_reward")
"""Settings of the environment that its policy and its discriminator were made for."""
_SEES = {True: "was adapted to uneven ground, which it sees", False: "was adapted without seeing the ground"}


class LowRun(SkillRun):
    """A run whose policy is followed."""

    def digest(self) -> str:
        """SHA-256 of its checkpoint's tensors."""
        return checkpoint_digest(self.folder / runs.LAST)

    def check_env(self, env: EnvConfig) -> None:
        """Refuse an environment that its policy cannot act in.

        Raises:
            CommandError: naming the setting.
        """
        self.check_same(_SETTING, "env", env, self.config.env, _ITS_OWN)
        sees = is_uneven(self.config.env.terrain)
        if self.config.base is not None and is_uneven(env.terrain) != sees:
            raise CommandError(
                f"env.terrain.kind={env.terrain.kind}: the policy of low={self.word} {_SEES[sees]}; "
                "drop env.terrain.*, or name another run"
            )

    def load(self, env: HumanoidVectorEnv) -> Any:
        """Its agent, to be followed in `env`.

        Raises:
            CommandError: its checkpoint is damaged, or another character's.
        """
        try:
            return load_player(self.kind, self.config.agent, env, self.config.seed, self.folder / runs.LAST)
        except AgentError as error:
            raise CommandError(f"low={self.word}: {error}") from None


def find(word: str, setting: str = _SETTING) -> LowRun | None:
    """The run that `low=word` names, or another setting that wants such a run; None for `none`.

    Raises:
        CommandError: there is no such run, it has no checkpoint, or it has learned a task itself.
    """
    if word == NONE:
        return None
    if is_task_run(word) or is_adaptnet_run(word):
        raise CommandError(f"{setting}={word}: this run has learned a task itself; name a run of ase, calm or case")
    return LowRun(word, foundations.trained_run(word, setting), configuration.load(Path(word)))


def identity(below: LowRun | None) -> dict[str, str]:
    """What a checkpoint keeps of the policy that it was trained over: where it was, and its digest."""
    return foundations.identity(_SETTING, below and below.folder)


def check_unchanged(below: LowRun | None, saved: dict[str, Any]) -> None:
    """Refuse another policy below than the one that a checkpoint was trained over.

    Args:
        below: what is there now.
        saved: content of the checkpoint.

    Raises:
        CommandError: their digests differ.
    """
    foundations.check_unchanged(_SETTING, NONE if below is None else below.word, below and below.folder, saved)
