"""`murmillo bench`, and what measures for it and for the benchmarks."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest
import torch

from murmillo.agents.common.exactness import WORDS
from murmillo.cli.benching import learning, measuring, stepping
from murmillo.cli.benching.turns import Spread, one_round, rate_of, ratio_of
from murmillo.envs import EnvConfig
from murmillo.envs.registration import env_config, make_task
from tests.cli.refusals import assert_refused

Murmillo = Callable[..., tuple[int, str, str]]


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Few worlds and few steps, so that a measurement takes a moment; torch gets its threads back."""
    threads = torch.get_num_threads()
    monkeypatch.setattr(stepping, "_WARMED", 3)
    monkeypatch.setattr(stepping, "WARM_UP", 2)
    monkeypatch.setattr(measuring, "WORLDS", (2, 5))
    monkeypatch.setattr(measuring, "_SAMPLES_A_TURN", 8)
    yield
    torch.set_num_threads(threads)


@pytest.mark.usefixtures("small")
def test_bench(murmillo: Murmillo, monkeypatch: pytest.MonkeyPatch, folder: Path, tiny: tuple[str, ...]) -> None:
    """An iteration has 64 samples, and is measured on a quarter of them."""
    monkeypatch.setattr(measuring, "MOST_SAMPLES", 20)
    status, out, err = murmillo("bench", *tiny, "seconds=0.01", "out=found.json")
    assert (status, err) == (0, "")
    found = json.loads((folder / "found.json").read_text())
    assert [path.name for path in folder.iterdir()] == ["found.json"]
    rates = found["rates"]
    assert list(rates) == ["physics step", "environment step", "rollout", "learner update", "training iteration"]
    assert rates["physics step"] > rates["environment step"] > 0
    # the seconds of an iteration are those of its parts
    assert 1 / rates["rollout"] + 1 / rates["learner update"] == pytest.approx(1 / rates["training iteration"])
    assert found["hours"] == pytest.approx(128 / rates["training iteration"] / 3600)
    assert list(found["worlds"]) == ["2", "5", "8"]
    assert "1" in found["threads"]
    assert found["fraction"] == 4
    assert "at 1/4 of its worlds and minibatches" in out
    for text in ("ase, smoke: 8 worlds, 1 threads", "4 x 1/120 s, 37 DoF", "128 samples take", "kept in found.json"):
        assert text in out
    for rate in rates.values():
        assert f"{rate:,.0f}" in out


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("seconds=0",), ("seconds=0", "above 0")),
        (("seconds=long",), ("seconds", "long")),
        (("out=found.txt",), ("out=found.txt", ".json")),
        (("out=nowhere/found.json",), ("out=nowhere/found.json", "exists")),
        (("--multirun",), ("--multirun", "--help")),
        (("run.resume=runs/x",), ("run.resume=runs/x", "drop")),
        (("task=location", "low=none"), ("task=location", "drop")),
        (("agent=adaptnet", "stage=adapt", "base=runs/x", "to=style"), ("stage=adapt", "drop")),
        (("sed=1",), ("sed", "seed")),
        (("agent=nobody",), ("nobody",)),
        (("num_envs=0",), ("num_envs=0",)),
        (("motions=nowhere",), ("nowhere",)),
        (("agent=adaptnet", "num_envs=0"), ("num_envs=0",)),
    ],
)
def test_wrong_words(murmillo: Murmillo, folder: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    assert_refused(murmillo("bench", *words), *parts)
    assert list(folder.iterdir()) == []


def test_the_fastest_is_ones_own_unless_another_is_noticeably_faster() -> None:
    assert measuring.fastest({64: 90.0, 256: 100.0, 1024: 104.0}, 256) == 256
    assert measuring.fastest({64: 90.0, 256: 100.0, 1024: 106.0}, 256) == 1024
    assert measuring.fastest({}, 4) == 4


def test_threads_are_doubled_up_to_all() -> None:
    assert [measuring.doubling(most) for most in (1, 2, 6, 8)] == [[1], [1, 2], [1, 2, 4, 6], [1, 2, 4, 8]]


def test_ratios_are_taken_within_rounds() -> None:
    rounds = [{"a": 1.0, "b": 2.0}, {"a": 30.0, "b": 40.0}, {"a": 5.0, "b": 5.0}]
    assert ratio_of(rounds, "a", "b") == Spread(0.75, 0.5, 1.0)
    assert rate_of(rounds, "a") == 5.0


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("task", ["Imitation", "Block", "Navigate"])
def test_worlds_begin_as_copies_of_few(task: str) -> None:
    """The seventh world is where the first is, and a step is timed for all of them."""
    config = env_config(task)
    env = stepping.make_warm(7, config, make_task(task))
    qpos = env.state.qpos
    torch.testing.assert_close(qpos[:3], qpos[3:6])
    torch.testing.assert_close(qpos[0], qpos[6])
    assert not torch.equal(qpos[0], qpos[1])
    contestant = stepping.Stepping(env, steps=2, label=", seven")
    rates = one_round([contestant])
    assert rates["physics step, seven"] > rates["environment step, seven"] > 0
    contestant.close()


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("matmul", ["highest", "bf16"])
def test_iterations_round_as_the_training_does(
    monkeypatch: pytest.MonkeyPatch, tiny: tuple[str, ...], matmul: str
) -> None:
    threads, rounded = torch.get_num_threads(), []
    trained = learning.Learning(learning.compose([*tiny, f"matmul={matmul}"]))
    monkeypatch.setattr(
        trained._runner.agent, "update", lambda rollout: rounded.append(torch.get_float32_matmul_precision())
    )
    trained.turn()
    trained.close()
    torch.set_num_threads(threads)
    assert rounded == [WORDS[matmul]]


def test_mean_contacts() -> None:
    """Four worlds hang in the air, one stands on the ground."""
    env = stepping.make_warm(5, EnvConfig())
    model = env.character.model
    standing = mujoco.MjData(model)
    standing.qpos[:3] = 0.0, 0.0, model.qpos0[2] - 0.02
    mujoco.mj_forward(model, standing)
    assert standing.ncon > 0
    qpos = torch.tensor(np.tile(standing.qpos, (5, 1)))
    qpos[1:, 2] += 5.0
    env.physics.write(torch.arange(5), qpos, torch.zeros(5, model.nv))
    assert stepping.mean_contacts(env) == pytest.approx(standing.ncon / 5)
    env.close()


def test_a_fraction_of_an_iteration_has_the_networks_of_the_whole() -> None:
    whole = learning.compose(["budget=paper"])
    part = learning.compose(["budget=paper", *learning.shrunk(whole, 8)])
    assert (whole.num_envs, part.num_envs) == (4096, 512)
    assert (whole.agent.ppo.minibatch, part.agent.ppo.minibatch) == (16384, 2048)
    assert (whole.agent.discriminator.minibatch, part.agent.discriminator.minibatch) == (4096, 512)
    assert part.agent.ppo.hidden == whole.agent.ppo.hidden
    assert part.runner.horizon == whole.runner.horizon
    calm = learning.compose(["agent=calm", "budget=paper"])
    assert "agent.encoder.pool=2048" in learning.shrunk(calm, 8)


def test_peak_memory_is_the_own_process() -> None:
    """Linux counts the memory of who started it into what getrusage says."""
    large = np.ones(40_000_000)  # 320 MB
    code = (
        "from murmillo.cli.benching.memory import peak_memory\n"
        "before = peak_memory()\nkept = bytearray(b'x' * 64_000_000)\nprint(before, peak_memory())"
    )
    before, after = map(int, subprocess.check_output([sys.executable, "-c", code]).split())
    assert before < large.nbytes / 2
    assert after - before > 60_000_000
