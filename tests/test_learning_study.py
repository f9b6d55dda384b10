"""`benchmarks/learning/study.py`: runs what is missing, goes on with what was begun, refuses what it cannot read."""

import importlib.util
import json
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest
import torch
import yaml

from murmillo.cli.adaptation.config import compose_adaptnet
from murmillo.cli.config import compose_train
from murmillo.cli.main import main

HERE = Path(__file__).parents[1] / "benchmarks" / "learning"
ABOUT_A_BASE = ("stage", "base", "to", "method", "ablation")
"""What an adaptation is told beside its base, which a test has not."""
TINY = [
    "num_envs=8",
    "runner.horizon=8",
    "agent.ppo.hidden=[16]",
    "agent.ppo.minibatch=32",
    "agent.ppo.epochs=1",
    "agent.discriminator.hidden=[16]",
    "agent.discriminator.minibatch=16",
    "warm_start.steps=0",
    "run.measured_worlds=2",
    "threads=1",
]
STUDY = {
    "question": "Is it faster?",
    "task": "walk",
    "samples": 128,
    "seeds": [1],
    "words": TINY,
    "variants": {"gamma_0.9": ["runner.gamma=0.9"], "gamma": []},
}


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, with studies and results in an empty working folder; it trains in this process."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(HERE))
    spec = importlib.util.spec_from_file_location("learning_study", HERE / "study.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "learning_study", module)  # where its dataclass looks for its annotations
    spec.loader.exec_module(module)
    (tmp_path / "studies").mkdir()
    (tmp_path / "tasks.yaml").write_text((HERE / "tasks.yaml").read_text())
    monkeypatch.setattr(module, "HERE", tmp_path)
    monkeypatch.setattr(module, "RESULTS", tmp_path / "docs")
    write(STUDY)
    return module


def write(content: object, name: str = "tiny") -> None:
    Path("studies", f"{name}.yaml").write_text(yaml.safe_dump(content, sort_keys=False))


def test_every_study_can_be_read(study: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "HERE", HERE)
    for file in (HERE / "studies").glob("*.yaml"):
        read = study.read(file.stem)
        assert read.variants
        for variant in read.variants:
            words = read.words_of(variant, 1)
            if study.ADAPTNET in words:
                compose_adaptnet([word for word in words if word.partition("=")[0] not in ABOUT_A_BASE])
            else:
                compose_train(words)  # either refuses what is no setting
        assert f"runner.samples={yaml.safe_load(file.read_text())['samples']}" in read.words
    assert "study.py discount" in (study.__doc__ or "")
    assert study.read("discount").words_of("gamma_97", 2)[-2:] == ["runner.gamma=0.97", "seed=2"]


def test_a_study_is_run_kept_and_taken_up_again(study: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []
    threads = torch.get_num_threads()

    def murmillo(words: list[str]) -> int:
        asked.append(words[1:])
        return main(words)

    monkeypatch.setattr(study, "murmillo", murmillo)
    study.main(["tiny"])
    assert [word for word in asked[0] if word.startswith(("clips", "runner.gamma", "runner.samples", "run.name"))] == [
        "clips=[walk_forward]", "runner.samples=128", "runner.gamma=0.9", "run.name=gamma_0.9-1",
    ]  # fmt: skip
    kept = json.loads(Path("docs", "tiny.json").read_text())
    assert list(kept["variants"]) == ["gamma_0.9", "gamma"]
    for variant in kept["variants"].values():
        assert list(variant["seeds"]) == ["1"]
        run = variant["seeds"]["1"]
        assert (run["samples"][0], run["samples"][-1]) == (64, 128)
        assert len(run["reward/style"]) == len(run["samples"])
        assert run["reward/style"][-1] > 0
        assert run["measured"]["length"] > 0
    assert Path("docs", "tiny.png").stat().st_size > 1000

    study.main(["tiny"])  # all is there
    assert len(asked) == 2
    # one that was stopped is taken up again; one without a checkpoint begins anew
    runs = Path("runs", "learning", "tiny")
    (runs / "gamma-1" / "measures.json").unlink()
    (runs / "gamma_0.9-1" / "measures.json").unlink()
    (runs / "gamma_0.9-1" / "checkpoints" / "last").rename(runs / "gamma_0.9-1" / "lost")
    study.main(["tiny"])
    assert asked[2] == asked[0]
    assert asked[3] == ["run.resume=runs/learning/tiny/gamma-1"]
    assert json.loads(Path("docs", "tiny.json").read_text())["variants"]["gamma"] == kept["variants"]["gamma"]

    write(STUDY | {"samples": 256})
    with pytest.raises(SystemExit, match=r"gamma_0\.9-1: was made with other settings"):
        study.main(["tiny"])
    torch.set_num_threads(threads)


def test_a_study_of_adaptnet_keeps_what_that_is_rewarded_for(
    study: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = torch.get_num_threads()
    monkeypatch.setattr(study, "murmillo", main)
    small = ["agent.recurrent=8", "agent.ppo.epochs=1", "agent.discriminator.recurrent=8", "env.episode_steps=80"]
    write(STUDY | {"task": "adaptnet", "words": [*TINY, *small], "variants": {"base": []}})
    study.main(["tiny"])
    run = json.loads(Path("docs", "tiny.json").read_text())["variants"]["base"]["seeds"]["1"]
    assert list(run) == [
        "samples",
        "seconds",
        "episode/length",
        "episode/fall_rate",
        "reward/task",
        "reward/imitation",
        "measured",
    ]
    assert -1 <= run["reward/imitation"][-1] <= 1
    assert run["measured"]["length"] > 0
    torch.set_num_threads(threads)


def test_skills_and_what_is_measured_on_the_way(study: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []
    threads = torch.get_num_threads()

    def murmillo(words: list[str]) -> int:
        asked.append(words)
        return main(words)

    monkeypatch.setattr(study, "murmillo", murmillo)
    monkeypatch.setattr(study, "TRAJECTORIES", 4)
    words = ["agent=case", "ablation=neither", *TINY]
    write(STUDY | {"task": "ten", "words": words, "variants": {"short": []}, "measured_every": 64})
    study.main(["tiny"])
    run = json.loads(Path("docs", "tiny.json").read_text())["variants"]["short"]["seeds"]["1"]
    assert {"guard", "run_forward"} < run["skills"].keys()
    assert all(0 < score < 1 for scores in run["skills"].values() for score in scores)
    assert run["along"]["samples"] == [64, 128]
    assert all(0 <= share <= 1 for name in ("coverage_10", "controllability") for share in run["along"][name])
    assert len(run["along"]["coverage_10"]) == 2
    assert Path("docs", "tiny_skills_short.png").stat().st_size > 1000

    study.main(["tiny"])  # nothing is trained or measured again
    assert [words[0] for words in asked] == ["train", "evaluate"]
    torch.set_num_threads(threads)


@pytest.mark.parametrize(
    ("content", "name", "line"),
    [
        (STUDY, "tinny", r"study tinny: there is no such file in .*; there are: tiny"),
        (
            STUDY | {"task": "wlak"},
            "tiny",
            r"tiny\.yaml: task: wlak is no line of tasks\.yaml; there are: walk, .*",
        ),
        ({**STUDY, "variants": None}, "tiny", r"tiny\.yaml: variants is missing; a study has question, task, .*"),
        (None, "tiny", r"tiny\.yaml: question is missing; .*"),
    ],
)
def test_what_is_no_study_is_refused_in_one_line(study: ModuleType, content: object, name: str, line: str) -> None:
    write(content)
    with pytest.raises(SystemExit) as refused:
        study.main([name])
    assert re.fullmatch(f".*{line}", str(refused.value))


def test_words_that_training_refuses(study: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "murmillo", main)
    write(STUDY | {"words": ["num_env=8"]})
    with pytest.raises(SystemExit, match="no run has made an iteration"):
        study.main(["tiny"])
    assert not Path("docs").exists()
