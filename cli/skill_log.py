"""The score of each skill in a run's log, by the skill's name."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from murmillo.agents.common.interface import Labelled
from murmillo.agents.common.logger import Logger

PREFIX = "skills/"


class SkillLogger(Logger):
    """Logs `skills/<name>` too: the discriminator's mean score, 0 to 1, of the motion under each label."""

    def __init__(self, folder: Path | str, agent: Labelled, names: Sequence[str]) -> None:
        """
        Args:
            folder: of the run.
            agent: that learns.
            names: of its K skills.
        """
        super().__init__(folder)
        self._agent, self._names = agent, [PREFIX + name for name in names]

    def log(self, samples: int, scalars: Mapping[str, float]) -> None:
        scores = self._agent.skill_tables()["score"].tolist()
        super().log(samples, {**scalars, **dict(zip(self._names, scores, strict=True))})
