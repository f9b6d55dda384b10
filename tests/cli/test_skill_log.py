"""The log of a run with labels follows each skill, and the report draws it."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from murmillo.cli import report, runs
from murmillo.cli.plots import plot_all, plot_skills
from murmillo.cli.skill_log import SkillLogger


class Scored:
    """Stands for an agent with labels; its skills' scores are set from outside."""

    def __init__(self, *scores: float) -> None:
        self.scores = torch.tensor(scores)

    def skill_tables(self) -> dict[str, Tensor]:
        return {"share": torch.full_like(self.scores, 0.5), "score": self.scores}

    def head_scores(self, rollout: object) -> dict[str, Tensor]:
        raise NotImplementedError


def test_each_iteration_has_the_scores_of_then(tmp_path: Path) -> None:
    agent = Scored(0.25, 0.5)
    logger = SkillLogger(tmp_path, agent, ["kick", "guard"])
    logger.log(10, {"samples_per_second": 5.0})
    agent.scores = torch.tensor([0.75, 0.125])
    logger.log(20, {"samples_per_second": 10.0})
    logger.close()
    logged = report.read_scalars(tmp_path / runs.SCALARS)
    assert logged["skills/kick"].tolist() == [0.25, 0.75]
    assert logged["skills/guard"].tolist() == [0.5, 0.125]
    assert logged["samples_per_second"].tolist() == [5.0, 10.0]


def test_a_run_begun_without_them_goes_on_without(tmp_path: Path) -> None:
    (tmp_path / runs.SCALARS).write_text("samples,reward/style\n10,1.0\n")
    logger = SkillLogger(tmp_path, Scored(0.25), ["kick"])
    logger.resume(10)
    logger.log(20, {"reward/style": 2.0})
    logger.close()
    assert (tmp_path / runs.SCALARS).read_text().split() == ["samples,reward/style", "10,1.0", "20,2.0"]


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """What a picture of skills shows: its rows' names and colours, filled when it is saved."""
    from matplotlib.figure import Figure

    found: dict[str, object] = {}

    def look(figure: Figure, path: Path) -> None:
        axes = figure.axes[0]
        found["file"] = path.name
        if axes.images:
            found["names"] = [label.get_text() for label in axes.get_yticklabels()]
            found["rows"] = np.asarray(axes.images[0].get_array())
            found["from to"] = axes.get_xlim()

    monkeypatch.setattr(Figure, "savefig", look)
    return found


def test_the_best_skill_is_on_top(tmp_path: Path, shown: dict[str, object]) -> None:
    scores = {"kick": np.array([0.0, 0.25]), "guard": np.array([0.5, 1.0]), "taunt": np.array([0.75, 0.5])}
    plot_skills(np.array([2.0, 6.0]), scores, "minutes", tmp_path / "skills.png")
    assert shown["names"] == ["guard", "taunt", "kick"]
    assert shown["from to"] == (2.0, 6.0)
    rows = shown["rows"]
    assert isinstance(rows, np.ndarray)
    assert rows[:, 0].tolist() == [0.5, 0.75, 0.0]
    assert rows[:, -1].tolist() == [1.0, 0.5, 0.25]
    assert (np.diff(rows[0]) > 0).all()


def test_the_report_draws_the_skills_that_were_logged(tmp_path: Path, shown: dict[str, object]) -> None:
    scalars = {"seconds": np.array([60.0, 120.0]), "reward/style": np.array([0.5, 1.0])}
    plot_all(scalars, tmp_path)
    assert shown["file"] == "rewards.png"
    plot_all(scalars | {"skills/kick": np.array([0.25, 0.75])}, tmp_path)
    assert (shown["file"], shown["names"], shown["from to"]) == ("skills.png", ["kick"], (1.0, 2.0))
