"""The report of made-up scalars has their means."""

import csv
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from murmillo.cli import obedience, report, runs
from murmillo.cli.plots import plot_all, smooth


@pytest.fixture
def run_folder(tmp_path: Path) -> Path:
    """Four minutes at 100 samples a second, an iteration of 6,000 samples a minute; two columns, one value missing."""
    folder = tmp_path / "made_up"
    folder.mkdir()
    with (folder / runs.SCALARS).open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["samples", "iteration", "samples_per_second", "episode/length", "discriminator/agent_score"])
        for minute, length in enumerate((20.0, "", 60.0, 80.0), start=1):
            writer.writerow([6000 * minute, minute, 100.0, length, 0.1 * minute])
    config = {
        "choices": {"agent": "ase", "budget": "smoke", "ablation": "no_diversity"},
        "motions": "builtin",
        "seed": 3,
        "num_envs": 256,
    }
    OmegaConf.save(OmegaConf.create(config), folder / runs.CONFIG)
    measured = {"episodes": 64, "steps": 1216, "fall_rate": 1.0, "score": 0.25, "rewards": {}}
    ages = {"untrained": {**measured, "length": 19.0}, "warm_started": {**measured, "length": 24.5}}
    runs.write_json(folder / runs.MEASURES, {**ages, "trained": {**measured, "length": 88.0}})
    return folder


def test_time_is_counted_from_samples_and_speed(run_folder: Path) -> None:
    assert report.read_scalars(run_folder / runs.SCALARS)["seconds"].tolist() == [60.0, 120.0, 180.0, 240.0]


def test_report_has_the_figures(run_folder: Path) -> None:
    text = report.write(run_folder).read_text()
    assert "24,000 samples" in text
    assert "in 4.0 minutes, 100 samples/s" in text
    assert "`no_diversity`" in text
    assert "| before training | 19.0 | 1.00 | 0.250 | 64 | 1,216 |" in text
    assert "by +5.5 steps" in text
    assert "| Episode length | 20 steps | 80 steps |" in text
    assert "| 2.0 | 12,000 | - | 0.200 |" in text  # no episode ended in the second minute
    for picture in ("plots/episode_length.png", "plots/discriminator.png"):
        assert f"({picture})" in text
        assert (run_folder / picture).read_bytes().startswith(b"\x89PNG")
    assert "fall_rate.png" not in text


def test_skills_are_told_with_what_they_have_left_of_forces() -> None:
    skills = {"guard": {"share": 0.25, "score": 0.5}, "kick": {"share": 0.75, "score": 0.125}}
    text = obedience.section({}, skills)
    assert "| skill | share of the practice | score |\n|---|---:|---:|\n| kick | 75.00 % | 0.125 |\n| guard" in text
    assert "forces" not in text
    helped = {name: skill | {"forces": 2 * skill["share"] - 0.5} for name, skill in skills.items()}
    text = obedience.section({}, helped)
    assert "| skill | share of the practice | score | forces |\n|---|---:|---:|---:|" in text
    assert "| kick | 75.00 % | 0.125 | 1.00 |\n| guard | 25.00 % | 0.500 | 0.00 |" in text


def test_a_short_run_is_told_by_its_quarters(run_folder: Path) -> None:
    with (run_folder / runs.SCALARS).open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["samples", "iteration", "samples_per_second", "episode/length"])
        writer.writerows([1000 * i, i, 100.0, 10.0 * i] for i in range(1, 5))
    text = report.write(run_folder).read_text()
    assert "| | first 10 s | last 10 s |" in text
    assert "| Episode length | 10 steps | 40 steps |" in text


def test_a_plot_shows_values_below_zero(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib.figure import Figure

    lowest: dict[str, float] = {}
    monkeypatch.setattr(
        Figure, "savefig", lambda figure, path: lowest.update({path.stem: figure.axes[0].get_ylim()[0]})
    )
    scalars = {"seconds": np.array([1.0, 2.0]), "reward/style": np.array([0.5, 1.0])}
    plot_all(scalars, tmp_path / "plots")
    assert lowest == {"rewards": 0.0}
    plot_all(scalars | {"reward/skill": np.array([-0.5, np.nan])}, tmp_path / "plots")
    assert lowest["rewards"] < -0.5


def test_report_says_how_well_the_encoder_knows_the_clips(run_folder: Path) -> None:
    assert "Fisher" not in report.write(run_folder).read_text()
    measures = runs.read_json(run_folder / runs.MEASURES)
    measures["untrained"] |= {"concentration": 0.632}
    measures["trained"] |= {"concentration": 0.246}
    runs.write_json(run_folder / runs.MEASURES, measures)
    text = report.write(run_folder).read_text()
    assert "| before training | 0.632 |\n| after training | 0.246 |" in text


def test_report_says_whether_the_label_is_obeyed(run_folder: Path) -> None:
    assert "as it is told" not in report.write(run_folder).read_text()
    measures = runs.read_json(run_folder / runs.MEASURES)
    measures["untrained"] |= {"heads": {"right": 0.5}}
    measures["trained"] |= {"heads": {"right": 0.6, "other": 0.25}, "residual_share": 0.0123}
    runs.write_json(run_folder / runs.MEASURES, measures)
    runs.write_json(
        run_folder / runs.SKILLS, {"idle": {"share": 0.3, "score": 0.9}, "kick": {"share": 0.7, "score": 0.1}}
    )
    text = report.write(run_folder).read_text()
    assert "| before training | 0.500 | - |" in text
    assert "| after training | 0.600 | 0.250 |" in text
    assert "an even one is 50.00 %" in text
    assert text.index("| kick | 70.00 % | 0.100 |") < text.index("| idle | 30.00 % | 0.900 |")
    assert "Residual forces: after training, 1.23 % of the PD control" in text


def test_report_says_why_there_is_no_video(run_folder: Path) -> None:
    runs.write_json(run_folder / runs.FILMING, {"reason": "no OpenGL"})
    assert "No video: no OpenGL" in report.write(run_folder).read_text()
    (run_folder / runs.VIDEO).touch()
    assert "(video.mp4)" in report.write(run_folder).read_text()


def test_report_says_how_to_go_on(run_folder: Path) -> None:
    text = report.write(run_folder).read_text()
    assert f"murmillo train run.resume={run_folder} runner.max_minutes=60 runner.samples=20000000\n" in text
    assert "murmillo train agent=ase budget=laptop\n" in text
    config = OmegaConf.load(run_folder / runs.CONFIG)
    config.choices.agent, config.motions = "case", "my clips"
    OmegaConf.save(config, run_folder / runs.CONFIG)
    assert "murmillo train agent=case budget=laptop 'motions=my clips'\n" in report.write(run_folder).read_text()
    config.choices.budget = "laptop"
    OmegaConf.save(config, run_folder / runs.CONFIG)
    assert "budget=laptop" not in report.write(run_folder).read_text()


def test_report_of_a_run_without_an_iteration(run_folder: Path) -> None:
    (run_folder / runs.SCALARS).unlink()
    assert "0 samples" in report.write(run_folder).read_text()


def test_smooth_leaves_out_what_is_missing() -> None:
    values = np.array([1.0, np.nan, 3.0, 5.0])
    assert smooth(values, share=0.75).tolist() == [1.0, 2.0, 4.0, 4.0]
