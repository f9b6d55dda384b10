"""`murmillo compare` on made-up runs: who is grouped with whom, what stands beside what, what is refused."""

import csv
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from omegaconf import OmegaConf

from murmillo.cli import runs
from murmillo.cli.compare import folders, gather
from murmillo.cli.comparison import page
from murmillo.cli.comparison.curves import curve
from murmillo.cli.comparison.record import read
from murmillo.cli.comparison.table import tabulate
from tests.cli.refusals import assert_refused

Murmillo = Callable[..., tuple[int, str, str]]

ITERATION = 1000
RATE = 100.0


def make_run(
    name: str,
    agent: str = "ase",
    seed: int = 1,
    score: float = 0.5,
    iterations: int = 10,
    style: tuple[float, ...] = (),
    coverage: float | None = None,
    commit: str = "abc",
    **settings: Any,
) -> Path:
    """A folder as `murmillo train` leaves it, with 1,000 samples an iteration at 100 a second."""
    folder = Path("runs") / name
    folder.mkdir(parents=True)
    config = OmegaConf.create(
        {
            "agent": {"ppo": {"hidden": [64]}, "discriminator": {"hidden": [32]}, "window": 10, "kappa": 1.0},
            "env": {"character": "sword_shield", "motions": "builtin", "episode_steps": 300, "threads": seed},
            "run": {"name": name},
            "choices": {"agent": agent, "budget": "smoke", "ablation": "none"},
            "motions": "builtin",
            "num_envs": 8,
            "seed": seed,
        }
    )
    for key, value in settings.items():
        OmegaConf.update(config, key.replace("__", "."), value)
    OmegaConf.save(config, folder / runs.CONFIG)
    runs.write_json(folder / runs.VERSIONS, {"git": {"commit": commit}, "machine": {"processor": "P"}, "threads": 1})
    rewards = style or (0.25,) * iterations
    with (folder / runs.SCALARS).open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["samples", "iteration", "samples_per_second", "reward/style", "episode/length"])
        for iteration, reward in enumerate(rewards, start=1):
            writer.writerow([ITERATION * iteration, iteration, RATE, reward, 20.0 + iteration])
    trained = {"episodes": 64, "steps": 999, "length": 40.0, "fall_rate": 1.0, "score": score, "heads": {}}
    runs.write_json(folder / runs.MEASURES, {"untrained": {**trained, "score": 0.0}, "trained": trained})
    if coverage is not None:
        evaluate(folder, coverage, ITERATION * len(rewards))
    return folder


def evaluate(folder: Path, coverage: float, samples: int, **conditions: Any) -> None:
    """What `murmillo evaluate` leaves of one figure."""
    (folder / runs.EVALUATION).mkdir(exist_ok=True)
    values = {"trained": {"value": coverage, "samples": 64, "spread": None}, "untrained": {"value": 0.01}}
    figure = {"title": "Coverage", "unit": "%", "better": "up", "values": values}
    metrics = {"coverage": {"protocols": ["300 steps"], "figures": {"coverage": figure}}}
    identity = {"samples": samples, "trajectories": 2000, "start": "default", "not_comparable": None, **conditions}
    runs.write_json(folder / runs.METRICS, {**identity, "metrics": metrics})


def row(text: str, beginning: str) -> list[str]:
    """Cells of the first line of a table whose first cell is this."""
    line = next(line for line in text.splitlines() if line.startswith(f"| {beginning} |"))
    return [cell.strip() for cell in line.strip("|").split("|")]


def page_of(*paths: Path) -> str:
    """The page of these runs, without pictures."""
    groups, left_out = gather(list(paths))
    return page.page(groups, left_out, tabulate(groups), [])


def test_seeds_are_one_group_with_an_interval(folder: Path) -> None:
    scores = (0.0, 0.4, 0.6, 0.8)
    text = page_of(*(make_run(f"s{seed}", seed=seed, score=score) for seed, score in enumerate(scores, start=1)))
    assert text.startswith("# 4 runs in 1 group\n")
    cells = row(text, "ase")
    assert cells[1] == "4"
    assert cells[2].startswith("0.5 [")  # without the seed out of the way the mean is 0.5, with it 0.45
    assert "| Style score ↑ | ase | 4 | 0.45 | 0.5 | [" in text
    assert "| 0 to 0.8 |" in text
    assert "Fewer than 5 seeds: `ase`" in text
    assert "A single seed" not in text


def test_a_single_seed_has_no_interval_and_the_page_says_so(folder: Path) -> None:
    text = page_of(make_run("a", score=0.47))
    assert row(text, "ase")[2] == "0.47"
    assert "A single seed, so no interval: `ase`" in text
    assert "| Style score ↑ | ase | 1 | 0.47 | 0.47 | single seed | - |" in text


def test_methods_stand_side_by_side(folder: Path) -> None:
    text = page_of(
        make_run("a", "ase", score=0.1, coverage=0.125),
        make_run("b", "case", score=0.2, coverage=0.25, agent__label_dim=64),
        make_run("c", "calm", score=0.3),
    )
    titles = row(text, "group")
    column = {title: place for place, title in enumerate(titles)}
    table = {agent: row(text, agent) for agent in ("ase", "case", "calm")}
    assert [cells[column["Style score ↑"]] for cells in table.values()] == ["0.1", "0.2", "0.3"]
    assert [cells[column["Coverage [%] ↑"]] for cells in table.values()] == ["12.5", "25", "-"]
    assert [cells[column["Samples"]] for cells in table.values()] == ["10,000"] * 3
    assert [cells[column["Throughput [samples/s] ↑"]] for cells in table.values()] == ["100"] * 3
    assert [cells[column["comparable"]] for cells in table.values()] == ["yes"] * 3
    assert "- Coverage [%] ↑: 300 steps; 2,000 trajectories; start default" in text
    assert "| `agent.label_dim` | absent | 64 | absent |" in text


@pytest.mark.parametrize(
    ("conditions", "said"),
    [
        ({"trajectories": 50}, "50 trajectories"),
        ({"samples": 4000}, "the policy at 4,000 samples"),
        ({"not_comparable": "2 clips differ"}, "2 clips differ"),
    ],
)
def test_evaluations_under_other_conditions_are_not_put_together(
    folder: Path, conditions: dict[str, Any], said: str
) -> None:
    paths = [make_run("a", seed=1, coverage=0.1), make_run("b", seed=2)]
    evaluate(paths[1], 0.2, **{"samples": 10_000, **conditions})
    groups, _ = gather(paths)
    table = tabulate(groups)
    coverages = {quantity.protocol: table[quantity]["ase"].scores for quantity in table if quantity.name == "coverage"}
    assert list(coverages.values()) == [(10.0,), (20.0,)]
    assert said in list(coverages)[1]


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"motions": "mine"}, "other clips: mine against builtin"),
        ({"env__character": "humanoid"}, "another character: humanoid against sword_shield"),
        ({"agent__ppo__hidden": [128]}, "other networks: agent.ppo.hidden [128] against [64]"),
        ({"agent": "calm", "agent__discriminator__hidden": [8]}, "agent.discriminator.hidden [8] against [32]"),
        ({"env__episode_steps": 600}, "other ends of an episode: env.episode_steps 600 against 300"),
        ({"iterations": 9}, "another number of samples: 9,000 against 10,000"),
        ({"agent__kappa": 2.0}, None),
        ({"agent": "calm", "agent__encoder__hidden": [8]}, None),
    ],
)
def test_what_cannot_be_compared_is_marked(folder: Path, settings: dict[str, Any], reason: str | None) -> None:
    (first, second), _ = gather([make_run("a"), make_run("b", seed=2, **{"num_envs": 16, **settings})])
    assert first.against == ()
    assert len(second.against) == (reason is not None)
    assert reason is None or reason in second.against[0]


@pytest.mark.parametrize(
    ("motions", "digests", "against"),
    [
        (("mine", "mine"), ({"kick": "1"}, {"kick": "2"}), ("other clips: mine were changed in between",)),
        (("mine", "yours"), ({"kick": "1"}, {"kick": "1"}), ()),
        (("mine", "yours"), ({"kick": "1"}, {}), ("other clips: yours against mine",)),
    ],
)
def test_clips_are_known_by_their_digests(
    folder: Path, motions: tuple[str, str], digests: tuple[dict[str, str], ...], against: tuple[str, ...]
) -> None:
    paths = [make_run(f"s{seed}", seed=seed, motions=place) for seed, place in enumerate(motions)]
    for path, known in zip(paths, digests, strict=True):
        runs.write_json(path / runs.CLIPS, known)
    groups, _ = gather(paths)
    assert len(groups) == 2
    assert groups[1].against == against


@pytest.mark.parametrize(
    ("others", "labels"),
    [
        ([{"agent": "calm"}], ["ase", "calm"]),
        ([{"choices__ablation": "no_focal", "agent__kappa": 2.0}], ["ase", "ase no_focal"]),
        ([{"motions": "mine", "agent__kappa": 2.0}], ["ase motions=builtin", "ase motions=mine"]),
        ([{"choices__budget": "laptop", "agent__kappa": 2.0}], ["ase budget=smoke", "ase budget=laptop"]),
        (
            [{"agent__kappa": 2.0}, {"agent__kappa": 2.0, "num_envs": 9}, {"agent": "calm"}],
            ["ase agent.kappa=1.0", "ase agent.kappa=2.0 num_envs=8", "ase agent.kappa=2.0 num_envs=9", "calm"],
        ),
    ],
)
def test_labels_say_as_little_as_tells_the_groups_apart(
    folder: Path, others: list[dict[str, Any]], labels: list[str]
) -> None:
    groups, _ = gather([make_run("a"), *(make_run(f"b{number}", **other) for number, other in enumerate(others))])
    assert [group.label for group in groups] == labels


def test_a_seed_counts_once(folder: Path) -> None:
    first = make_run("a", seed=1)
    groups, left_out = gather([first, make_run("b", seed=1), make_run("c", seed=2)])
    assert [run.folder.name for run in groups[0].runs] == ["a", "c"]
    assert left_out == [(Path("runs/b"), "has the settings and the seed of runs/a")]


def test_the_same_seed_of_other_sources_is_another_group(folder: Path) -> None:
    groups, left_out = gather([make_run("a", commit="1111"), make_run("b", commit="2222")])
    assert [group.label for group in groups] == ["ase sources=1111", "ase sources=2222"]
    assert left_out == []


def test_runs_without_an_iteration_are_left_out(folder: Path) -> None:
    begun = make_run("b", seed=2)
    (begun / runs.SCALARS).unlink()
    assert "- `runs/b` never finished an iteration" in page_of(make_run("a"), begun)


def test_curves_are_read_where_the_shortest_run_ends(folder: Path) -> None:
    paths = [make_run("a", style=(1.0,) * 4), make_run("b", "calm", style=(0.0, 0.0, 0.0, 3.0, 9.0, 9.0))]
    table = tabulate(gather(paths)[0])
    found = {quantity.title: summaries for quantity, summaries in table.items()}
    assert found["Style reward while training"]["calm"].scores == (9.0,)
    assert found["Style reward at 4,000 samples"]["calm"].scores == (3.0,)  # the last tenth of them is one iteration
    assert found["Style reward at 4,000 samples"]["ase"].scores == (1.0,)


def test_the_history_of_coverage_is_of_evaluations_like_the_latest(folder: Path) -> None:
    path = make_run("a", coverage=0.5)
    rows = ("2000,64,default,0.2", "4000,99,default,0.9", "10000,64,default,0.5")
    (path / runs.HISTORY).write_text("\n".join(["samples,trajectories,start,coverage", *rows, ""]))
    run = read(path)
    assert run is not None
    places, seeds = curve((run,), "coverage", "seconds")
    assert (places[0], places[-1]) == (20.0, 100.0)
    np.testing.assert_allclose(np.interp(60.0, places, seeds[0]), 0.35, rtol=1e-12)


def test_a_curve_goes_from_the_last_beginning_to_the_first_end(folder: Path) -> None:
    short = read(make_run("a", style=(1.0, 2.0, 3.0)))
    late = read(make_run("b", style=(math.nan, 5.0, 7.0, 9.0)))
    assert short is not None
    assert late is not None
    places, seeds = curve((short, late), "reward/style", "samples")
    assert (places[0], places[-1]) == (2000.0, 3000.0)
    middle = np.array([np.interp(2500.0, places, values) for values in seeds])
    np.testing.assert_allclose(middle, [2.5, 6.0], rtol=1e-12)
    hours, _ = curve((short, late), "reward/style", "seconds")
    assert (hours[0], hours[-1]) == (20.0, 30.0)


def test_the_command_writes_the_page_and_pictures_of_what_was_logged(murmillo: Murmillo, folder: Path) -> None:
    for seed in (1, 2):
        made = make_run(f"s{seed}", seed=seed, coverage=0.5)
        rows = ("4000,64,default,0.2", "10000,64,default,0.5")
        (made / runs.HISTORY).write_text("\n".join(["samples,trajectories,start,coverage", *rows, ""]))
    (make_run("begun") / runs.SCALARS).unlink()
    status, out, err = murmillo("compare", "runs/*", "out=c")
    assert (status, err) == (0, "")
    assert "left out: runs/begun never finished an iteration\nwritten: c/comparison.md\n" in out
    text = (folder / "c" / "comparison.md").read_text()
    names = {path.name for path in (folder / "c").iterdir()}
    assert names == {"comparison.md", "reward_style.png", "episode_length.png", "coverage.png"}
    for name in names - {"comparison.md"}:
        assert f"({name})" in text
        assert (folder / "c" / name).read_bytes().startswith(b"\x89PNG")


def test_each_run_is_taken_once_and_a_pattern_takes_runs_only(folder: Path) -> None:
    made = [make_run("a"), make_run("b")]
    Path("runs/notes").mkdir()
    assert folders(["runs/b", "runs/*", str(folder / "runs" / "a")]) == [made[1], made[0]]


def test_a_name_may_have_an_equals_sign(murmillo: Murmillo, folder: Path) -> None:
    make_run("seed=7").rename("seed=7")
    status, out, _ = murmillo("compare", "seed=7")
    assert status == 0
    (written,) = Path("comparisons").glob("*/comparison.md")
    assert f"written: {written}" in out
    assert "`seed=7`" in written.read_text()


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        ((), ("at least one run",)),
        (("out=c",), ("at least one run",)),
        (("runs/nothing",), ("runs/nothing", "there is no such run", "good")),
        (("runs/good", "empty"), ("empty", "is no run", "config.yaml")),
        (("runs/bad*",), ("runs/bad*", "no run with a name like this")),
        (("runs/begun",), ("runs/begun", "never finished an iteration")),
        (("runs/good", "into=c"), ("into", "out")),
        (("runs/good", "--plot"), ("--plot",)),
        (("runs/good", "out=file"), ("out=file", "file")),
        (("runs/good", "out=file/c"), ("out=file/c", "file")),
        (("runs/yaml",), ("runs/yaml/config.yaml",)),
        (("runs/json",), ("runs/json/measures.json",)),
        (("runs/list",), ("runs/list/measures.json",)),
        (("runs/csv",), ("runs/csv/scalars.csv",)),
        (("runs/metrics",), ("runs/metrics/evaluation/metrics.json", "not what")),
    ],
)
def test_bad_input(murmillo: Murmillo, folder: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    make_run("good")
    (make_run("begun") / runs.SCALARS).unlink()
    (make_run("yaml") / runs.CONFIG).write_text("a: [")
    (make_run("json") / runs.MEASURES).write_text('{"trained": ')
    (make_run("list") / runs.MEASURES).write_text("[]")
    (make_run("csv") / runs.SCALARS).write_text("samples,samples_per_second\n1000,x\n")
    runs.write_json(make_run("metrics", coverage=0.1) / runs.METRICS, {"metrics": {"coverage": {"value": 1}}})
    Path("empty").mkdir()
    Path("file").touch()
    before = sorted(path.name for path in folder.iterdir())
    done = murmillo("compare", *words)
    assert_refused(done, *parts)
    assert done[1] == ""
    assert sorted(path.name for path in folder.iterdir()) == before


def test_a_real_run(trained: Path) -> None:
    text = page_of(trained)
    score = runs.read_json(trained / runs.MEASURES)["trained"]["score"]
    assert row(text, "ase")[2] == f"{score:.3g}"
    assert row(text, "ase")[-1] == "yes"


def test_help(murmillo: Murmillo) -> None:
    status, out, _ = murmillo("compare", "--help")
    assert status == 0
    assert out.startswith("murmillo compare")


def test_decisions_count_as_the_control_steps_that_they_take(folder: Path) -> None:
    steps, decisions = read(make_run("low")), read(make_run("high", latent_env__steps=5))
    assert steps is not None
    assert decisions is not None
    for name in ("samples", "episode/length"):
        assert decisions.scalars[name].tolist() == (5 * steps.scalars[name]).tolist()
