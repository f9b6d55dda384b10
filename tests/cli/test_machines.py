"""Machines from the file to the film: the shipped ones, the commands, the log, and what is refused."""

import csv
import itertools
import json
import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from imageio_ffmpeg import count_frames_and_secs
from torch.nn.functional import normalize

from murmillo.agents.calm.agent import CALM
from murmillo.agents.calm.machine.execution import Execution
from murmillo.agents.calm.machine.machine import OWN_QUANTITIES, Clip, Heading, Machine, Vocabulary
from murmillo.agents.common.task_agent import TaskAgent
from murmillo.cli import gl
from murmillo.cli.encodings import encode_middles
from murmillo.cli.machines.evaluate import MachineEvaluateConfig
from murmillo.cli.machines.files import Chosen, choose, shipped
from murmillo.cli.machines.published import published_rate
from murmillo.cli.machines.scene import MachineScene
from murmillo.cli.main import main
from murmillo.cli.tasks.names import task_class, task_names
from murmillo.envs.character import load_character
from tests.cli.refusals import assert_refused
from tests.cli.tiny_tasks import TINY_TASK

Murmillo = Callable[..., tuple[int, str, str]]

STYLES = ("run_forward", "walk_forward", "crouch_walk")
ENDINGS = ("guard", "roar", "block_crouched")
ATTACKS = (
    "kick",
    "shield_charge",
    "slash_left",
    "swipe",
    "shield_bash",
    "slash_right",
    "slash_down",
    "stab",
    "spin_attack",
)
CLIPS = tuple(Path(str(path)).stem for path in files("murmillo.assets.motions.sword_shield").iterdir())
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def directed(tmp_path_factory: pytest.TempPathFactory, tiny: tuple[str, ...]) -> Path:
    """A folder with a tiny run of CALM, `calm`, and one of precision training over it; only to be read."""
    root, threads = tmp_path_factory.mktemp("machines"), torch.get_num_threads()
    small = ("agent.encoder.hidden=[16]", "agent.encoder.minibatch=16", "agent.encoder.pool=32", "runner.samples=64")
    at = f"run.root={root}"
    assert main(["train", "agent=calm", *tiny, *small, "warm_start.steps=0", at, "run.name=calm"]) == 0
    assert main(["train", "task=direction", f"low={root}/calm", *TINY_TASK, at, "run.name=precision"]) == 0
    torch.set_num_threads(threads)
    return root


@pytest.fixture
def own(directed: Path, folder: Path) -> Path:
    """A copy of these runs in the working folder; `precision` still knows `calm` by its first place."""
    return Path(shutil.copytree(directed, folder / "runs"))


def chosen(*words: str) -> Chosen:
    return choose(MachineEvaluateConfig, [*words, "run=runs/calm"])[1]


def machine_of(choice: Chosen) -> Machine:
    task: Any = task_class(choice.file.task)
    return choice.file.machine(
        Vocabulary(tuple(task.quantity_docs), tuple(task.place_docs), CLIPS, STYLES), choice.parameters
    )


# --- the shipped machines --------------------------------------------------------------------------------------------


def thresholds(machine: Machine) -> list[float]:
    """The squares of the distances below which the character slows down, and then stops or strikes [m²]."""
    conditions = [t.condition.text for state in machine.states for t in state.transitions]
    return [float(text.split()[-1]) ** 2 for text in conditions if text.startswith("distance < ")]


@pytest.mark.parametrize(
    ("attack", "run", "walk", "crouch"),
    [("kick", 50, 11, 9), ("slash_left", 22, 8, 5.5), ("swipe", 22, 8, 5.5), ("shield_charge", 15, 7, 7)],
)
def test_strike_has_the_releases_distances_in_metres(attack: str, run: float, walk: float, crouch: float) -> None:
    for style, blow in (("run_forward", walk), ("walk_forward", walk), ("crouch_walk", crouch)):
        made = machine_of(chosen("machine=strike", "distances=published", f"attack={attack}", f"style={style}"))
        assert thresholds(made) == pytest.approx([run, blow], abs=0.05)
    assert math.cos(0.795) == pytest.approx(0.7, abs=1e-3)
    assert math.cos(1.369) == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize(("ending", "run"), [("guard", 7), ("roar", 9), ("block_crouched", 7)])
def test_location_has_the_releases_distances_in_metres(ending: str, run: float) -> None:
    made = machine_of(chosen("machine=location", "distances=published", f"ending={ending}"))
    assert thresholds(made) == pytest.approx([run, 3], abs=0.05)


def follow_perfectly(choice: Chosen, dt: float = 1 / 6) -> tuple[Machine, Execution, list[float]]:
    """Two worlds without physics, where everybody does what is commanded; also when each has succeeded [s]."""
    machine, n = machine_of(choice), 2
    cls: Any = task_class(choice.file.task)
    task = cls(cls.config_type(**choice.file.arguments))
    task.bind(n, load_character())
    state: Any = SimpleNamespace(
        qpos=torch.zeros(n, 7, dtype=torch.float64), qvel=torch.zeros(n, 6, dtype=torch.float64),
        prop_qpos=torch.zeros(n, 1, 7, dtype=torch.float64), prop_qvel=torch.zeros(n, 1, 6, dtype=torch.float64),
    )  # fmt: skip
    state.qpos[:, 3] = 1.0
    task.reset(torch.arange(n), state, torch.Generator().manual_seed(1))
    if "target_w" in getattr(task, "goals", {}):
        task.goals["target_w"][0] = torch.tensor([10.0, 10.0])  # the farthest that there is
    execution, success = Execution(machine, n, dt), [math.nan] * n
    assert machine.success is not None
    for step in range(round(choice.file.seconds / dt)):
        if all(time < step * dt - 1.0 for time in success):  # another second to see what they do then
            break
        for world, number in enumerate(execution.step(task.quantities(state)).tolist()):
            match machine.states[number].command:
                case Heading(place, _, speed):
                    way = task.places(state)[place][world] - state.qpos[world, :2]
                    state.qvel[world, :2] = speed * normalize(way, dim=-1)
                    state.qpos[world, :2] += dt * state.qvel[world, :2]
                case Clip(name):
                    state.qvel[world] = 0.0
                    if name == choice.parameters.get("attack"):
                        state.prop_qpos[world, 0, 3:] = torch.tensor([math.cos(0.75), math.sin(0.75), 0.0, 0.0])
        for world, done in enumerate(machine.success(execution.known(task.quantities(state))).tolist()):
            if done and math.isnan(success[world]):
                success[world] = (step + 1) * dt
    return machine, execution, success


@pytest.mark.parametrize("style", STYLES)
def test_who_does_what_location_commands_succeeds(style: str) -> None:
    for ending in ENDINGS:
        machine, execution, success = follow_perfectly(chosen("machine=location", f"style={style}", f"ending={ending}"))
        assert not any(math.isnan(time) for time in success)
        assert [change.target for change in execution.changes if change.world == 0] == ["arrive", "stay"]
        assert {machine.states[number].name for number in execution.state.tolist()} == {"stay"}


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("distances", ["pack", "published"])
def test_who_does_what_strike_commands_succeeds(style: str, distances: str) -> None:
    for attack in ("kick", "shield_charge", "stab") if distances == "pack" else ("kick", "swipe"):
        words = (f"style={style}", f"attack={attack}", f"distances={distances}")
        machine, execution, success = follow_perfectly(chosen("machine=strike", *words))
        assert not any(math.isnan(time) for time in success)
        for world in range(2):
            path = [change.target for change in execution.changes if change.world == world]
            assert path == ["close_in", "strike", "rest"]
        assert machine.states[int(execution.state[0])].command == Clip("idle_alert")


def test_every_attack_has_its_distances() -> None:
    for style, attack in itertools.product(STYLES, ATTACKS):
        slow_down, blow = thresholds(machine_of(chosen("machine=strike", f"style={style}", f"attack={attack}")))
        assert blow < slow_down


def test_published_rates_belong_to_shipped_machines_only() -> None:
    rates = [published_rate(chosen("machine=strike", f"style={s}", f"attack={a}")) for s in STYLES for a in ATTACKS[:3]]
    assert rates == [0.96, 1.0, 0.99, 0.98, 1.0, 0.96, 0.99, 0.99, 0.99]
    assert published_rate(chosen("machine=location", "ending=block_crouched", "style=crouch_walk")) == 0.97
    assert published_rate(chosen("machine=strike", "attack=stab")) is None


def test_the_page_has_every_quantity_and_every_machine() -> None:
    page = (ROOT / "docs" / "machines.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| ")]
    told = {
        (task, name.strip("`"), text.removesuffix(" |")) for tasks, name, text in rows for task in tasks[2:].split(", ")
    }
    common = task_class("speed").quantity_docs
    assert {(name, text) for task, name, text in told if task == "every"} == {*common.items(), *OWN_QUANTITIES.items()}
    for task in task_names():
        own = {(task, *item) for item in task_class(task).quantity_docs.items() if item[0] not in common}
        assert {row for row in told if row[0] == task} == own
    assert all(f"conf/machines/{name}.yaml" in page for name in shipped())


# --- commands --------------------------------------------------------------------------------------------------------

TRY = ("evaluate", "machine=location", "run=runs/calm", "heading=runs/precision", "worlds=4", "seconds=1.5")


def test_an_evaluation_and_its_log(murmillo: Murmillo, own: Path) -> None:
    far = ("reach.pack.roar.slow_down=30", "reach.pack.roar.stop=25", "style=walk_forward", "ending=roar")
    logs = []
    for threads in (1, 2):
        status, out, err = murmillo(*TRY, *far, f"threads={threads}")
        assert status == 0, err
        assert "Successful attempts of 4" in out
        assert "100.0 %" in out  # of CALM: celebrating after a walk
        log = own / "calm" / "machines" / "location-walk_forward-roar-pack" / "transitions.csv"
        logs.append(log.read_text())
    assert logs[0] == logs[1]
    rows = list(csv.DictReader(logs[0].splitlines()))
    assert [tuple(row.values()) for row in rows[:5]] == [
        *((str(world), "0", "0.000", "go", "arrive", "distance < 30.0") for world in range(4)),
        ("0", "1", "0.167", "arrive", "stay", "distance < 25.0"),
    ]
    results = json.loads((log.parent / "results.json").read_text())
    assert results["parameters"]["reach"]["pack"]["roar"] == {"slow_down": 30.0, "stop": 25.0}
    assert results["transitions"] == len(rows) == 8
    assert results["states"] == pytest.approx({"go": 0.0, "arrive": 1 / 9, "stay": 8 / 9})
    assert results["success_rate"] == results["successes"] / 4
    assert len(results["checkpoint"]) == len(results["heading_checkpoint"]) == 64


def test_what_the_states_tell_the_agent(directed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The policy is told the way to the target, the pace and the style; the state of a clip gives its encoding."""
    told, followed = [], []
    act, follow = TaskAgent.act, CALM.follow
    monkeypatch.setattr(TaskAgent, "act", lambda self, obs, **how: told.append(obs) or act(self, obs, **how))
    monkeypatch.setattr(CALM, "follow", lambda self, latent: followed.append(latent) or follow(self, latent))
    words = ["machine=location", f"run={directed}/calm", f"heading={directed}/precision", "threads=1"]
    changes = ["style=crouch_walk", "pace.crouch_walk=0.9", "reach.pack.guard.slow_down=30", "reach.pack.guard.stop=25"]
    settings, choice = choose(MachineEvaluateConfig, [*words, *changes])
    scene = MachineScene(settings, choice, 2, seconds=1.0)
    try:
        env: Any = scene.world.env
        decisions: Any = scene.world.decisions
        scene.reset(seed=3)
        qpos = env.state.qpos.clone()
        qpos[:, :2] = torch.tensor([3.0, -2.0])
        env.physics.write(torch.arange(2), qpos, torch.zeros_like(env.state.qvel))
        way = normalize(torch.as_tensor(env.observation()["goal"]), dim=-1)
        first, second = scene.step(), scene.step()
        guard = encode_middles(decisions.low, env.library, ["guard"])
    finally:
        scene.close()
    assert [scene.machine.states[int(states[0])].name for states in (first, second)] == ["arrive", "stay"]
    assert len(told) == 1
    assert torch.allclose(told[0]["goal"], torch.cat((way, torch.full((2, 1), 0.9), way), dim=-1), atol=1e-6)
    assert told[0]["skill"].tolist() == [env.skills.index("crouch_walk")] * 2
    assert torch.allclose(followed[1], guard.expand(2, -1), atol=1e-6)
    assert not torch.allclose(followed[0], followed[1])


def test_a_machine_of_ones_own_may_do_without_a_heading(murmillo: Murmillo, own: Path, folder: Path) -> None:
    (folder / "mine.yaml").write_text(
        "task: speed\nseconds: 1\nstart: a\nsuccess: time > 0.5\nstates:\n"
        "  a:\n    clip: kick\n    transitions:\n      - {to: b, when: time_in_state >= 0.5}\n  b:\n    clip: roar\n"
    )
    status, _, err = murmillo("evaluate", "machine=mine.yaml", "run=runs/calm", "worlds=2", "threads=1")
    assert status == 0, err
    results = json.loads((own / "calm" / "machines" / "mine" / "results.json").read_text())
    assert results["states"] == {"a": 0.5, "b": 0.5}
    assert results["success_rate"] == 1.0
    assert results["time_to_success"] == pytest.approx(16 / 30)
    assert results["published_success_rate"] is None


def test_a_film_has_a_picture_of_every_control_step(own: Path) -> None:
    if all(gl.why_not(backend) for backend in gl.candidates()):
        pytest.skip("no OpenGL draws on this machine")
    run = [sys.executable, "-m", "murmillo.cli.main", "record", *TRY[1:4], "seconds=0.1", "out=film.mp4"]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert count_frames_and_secs(str(own / "calm" / "film.mp4"))[0] == 3
    assert not list((own / "calm").glob(".*"))


# --- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("machine=locaton",), ("machine=locaton", "location or strike", "no such machine")),
        (("machine=nothing.yaml",), ("machine=nothing.yaml", "No such file", "location or strike")),
        (("machine=location", "run=runs/nothing"), ("run=runs/nothing", "no such run")),
        (("machine=location",), ("run", "needed")),
        (("machine=location", "run=runs/calm", "stile=walk_forward"), ("stile", "did you mean style")),
        (("machine=location", "run=runs/calm", "trajectories=3"), ("trajectories", "no setting")),
        (("machine=location", "run=runs/calm", "slow=fast"), ("slow=fast", "no number")),
        (("machine=location", "run=runs/calm", "slow=1e400"), ("slow=1e400", "no number")),
        (("machine=location", "run=runs/calm", "slow.er=1"), ("slow.er=1", "slow is no table", "slow alone")),
        (("machine=location", "run=runs/calm", "reach.pack=1"), ("reach.pack=1", "pack is a table", "pack.guard")),
        (("machine=location", "run=runs/calm", "worlds=0"), ("worlds=0",)),
        (("machine=location", "run=runs/calm", "seconds=nan"), ("seconds=nan", "above 0")),
        (("machine=location", "run=runs/calm", "seed=-1"), ("seed=-1",)),
        (("machine=location", "run=runs/calm", "worlds"), ("worlds", "name=value")),
    ],
)
def test_wrong_words(murmillo: Murmillo, folder: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    assert_refused(murmillo("evaluate", *words), *parts)
    assert list(folder.iterdir()) == []


def test_runs_that_do_not_serve(murmillo: Murmillo, own: Path, own_run_of_ase: Path) -> None:
    location = ("evaluate", "machine=location", "worlds=1", "threads=1")
    train = "murmillo train task=direction low=runs/calm"
    assert_refused(murmillo(*location, "run=runs/calm"), "machine=location", "heading=runs/<name>", train)
    assert_refused(murmillo(*location, f"run={own_run_of_ase}"), "a run of ase", "agent=calm")
    assert_refused(murmillo(*location, "run=runs/precision"), "run=runs/precision", "heading=runs/precision")
    assert_refused(murmillo(*location, "run=runs/calm", "heading=runs/calm"), "heading=runs/calm", train)
    assert_refused(murmillo(*location, "run=runs/calm", "heading=runs/gone"), "heading=runs/gone", "no such run")
    heading = ("run=runs/calm", "heading=runs/precision")
    assert_refused(murmillo(*location, *heading, "ending=rore"), "location.yaml:", "no entry rore", "did you mean roar")
    meta = own / "precision" / "checkpoints" / "last" / "meta.json"
    meta.write_text(meta.read_text().replace('"meta/low_digest": "', '"meta/low_digest": "0'))
    assert_refused(murmillo(*location, *heading), "heading=runs/precision", "not the one")
    assert not (own / "calm" / "machines").exists()


@pytest.fixture
def own_run_of_ase(trained: Path) -> Path:
    return trained


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("task: location", "task: locaton", "did you mean location"),
        ("radius: 10.0", "radios: 10.0", "arguments: radios"),
        ("radius: 10.0", "radius: ten", "arguments: radius"),
        ("radius: 10.0", "radius: -1", "task.radius=-1"),
        ("  slow:", "  seed:", "seed is a setting"),
    ],
)
def test_files_that_do_not_fit(murmillo: Murmillo, own: Path, folder: Path, old: str, new: str, part: str) -> None:
    text = files("murmillo.conf.machines").joinpath("location.yaml").read_text(encoding="utf-8")
    assert text.count(old) == 1
    (folder / "mine.yaml").write_text(text.replace(old, new))
    before = text.partition(old)[0].splitlines()
    line = before.index("arguments:") + 1 if "radius" in old else len(before) + 1  # those of hydra name no line
    done = murmillo("evaluate", "machine=mine.yaml", "run=runs/calm", "heading=runs/precision", "worlds=1")
    assert_refused(done, f"mine.yaml:{line}: ", part)
