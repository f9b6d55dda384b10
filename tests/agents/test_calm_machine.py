"""The language of machines: what conditions mean, what is refused in which line, how worlds go through states."""

import re

import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from torch import Tensor

from murmillo.agents.calm.machine.condition import Condition
from murmillo.agents.calm.machine.execution import Change, Execution
from murmillo.agents.calm.machine.machine import Clip, Heading, Machine, Vocabulary
from murmillo.agents.calm.machine.parameters import Value, overridden
from murmillo.agents.calm.machine.reading import MachineFile
from murmillo.agents.common.errors import AgentError

WORDS = Vocabulary(("distance", "speed"), ("target",), ("guard", "kick", "roar"), ("run", "walk"))
MACHINE = """\
task: location
arguments: {radius: 3.0}
seconds: 12
parameters:
  style: run
  ending: guard
  stop:
    guard: {run: 2.0, walk: 1.0}
    roar: {run: 4.0, walk: 3.0}
  pace: {run: 3, walk: 1.5}
start: go
success: distance < 1 and speed < 0.5
states:
  go:
    heading: {towards: target, style: $style, speed: "$pace[style]"}
    transitions:
      - {to: stay, when: "distance < stop[ending][style]"}
  stay:
    clip: $ending
    transitions:
      - {to: "on", when: time_in_state > 0.3}
      - {to: go, when: distance > 5}
  on:
    clip: kick
"""


def machine(text: str = MACHINE, **parameters: str) -> Machine:
    file = MachineFile(text, "m.yaml")
    chosen = file.parameters
    for name, value in parameters.items():
        chosen = overridden(chosen, name.replace("__", "."), value)
    return file.machine(WORDS, chosen)


def refusal(text: str) -> str | None:
    """What is said of a machine; None if it is one."""
    try:
        machine(text)
    except AgentError as error:
        return str(error)
    return None


def figures(**values: list[float]) -> dict[str, Tensor]:
    return {name: torch.tensor(value, dtype=torch.float64) for name, value in values.items()}


# --- conditions ------------------------------------------------------------------------------------------------------

PARAMETERS: dict[str, Value] = {"near": 2.0, "style": "run", "stop": {"run": 3.0, "walk": {"kick": 1.0}}}


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("distance < 2", [True, False, False]),
        ("distance <= near", [True, True, False]),
        ("not distance <= near", [False, False, True]),
        ("distance > speed", [False, True, True]),
        ("distance < stop[style]", [True, True, False]),
        ("distance < stop.walk.kick or speed >= 1", [True, True, True]),
        ("1 < distance < 3 and speed > -0.5", [False, True, False]),
        ("speed < 1.5 and not (distance > 1 and distance < 3)", [False, False, True]),
    ],
)
def test_what_conditions_mean(text: str, holds: list[bool]) -> None:
    known = figures(distance=[1.0, 2.0, 3.0], speed=[2.0, 1.0, 1.0])
    assert Condition(text, known, PARAMETERS)(known).tolist() == holds


def test_no_comparison_with_what_is_no_number_holds() -> None:
    known = figures(distance=[float("nan")])
    assert not Condition("distance < 1 or distance >= 1", known, {})(known)


def test_a_condition_shows_the_numbers_of_its_parameters() -> None:
    assert Condition("distance<stop[style]  or speed>near", ("distance", "speed"), PARAMETERS).text == (
        "distance < 3.0 or speed > 2.0"
    )


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("distanse < 1", ("distanse", "did you mean distance")),
        ("distance <", ("cannot be read", "distance < 1.5")),
        ("distance", ("no comparison",)),
        ("distance < 1 and speed", ("speed", "no comparison")),
        ("1 < 2", ("none of the quantities",)),
        ("near < stop[style]", ("none of the quantities",)),
        ("distance == 1", ("<, <=, >, >=",)),
        ("distance < style", ("style", "the name run", "number")),
        ("distance < stop", ("stop", "table of run, walk")),
        ("distance < stop[near]", ("no entry 2.0",)),
        ("distance < stop.rum", ("no entry rum", "did you mean run")),
        ("distance < near.run", ("near is no table",)),
        ("distance < stop['run']", ("neither a parameter",)),
        ("distance < 'far'", ("'far'", "neither a quantity nor a number")),
        ("distance < True", ("neither a quantity nor a number",)),
        ("distance < 1 + 1", ("1 + 1",)),
        ("abs(distance) < 1", ("abs",)),
        ("__import__('os').system('true') < distance", ("neither a parameter",)),
        ("(lambda: distance)() < 1", ("lambda",)),
        ("[d for d in distance] < distance", ("no such quantity or parameter",)),
        ("not " * 30 + "distance < 1", ("nested",)),
        ("(" * 300 + "distance < 1", ("cannot be read",)),
        ("1is distance", ("cannot be read",)),
        ("distance < 1\0", ("cannot be read",)),
    ],
)
def test_what_is_no_condition(text: str, parts: tuple[str, ...]) -> None:
    with pytest.raises(AgentError) as refused:
        Condition(text, ("distance", "speed"), PARAMETERS)
    assert "\n" not in str(refused.value)
    for part in parts:
        assert part in str(refused.value)


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="distance<>=()[]. 0123andornotstopnear_-+*:;'\"\\\n,", max_size=40))
@example("-" * 500 + "distance")
@example("distance < " + "9" * 5000)
@example("distance < 1e999")
def test_any_text_is_a_condition_or_refused(text: str) -> None:
    known = figures(distance=[1.0], speed=[0.0])
    try:
        condition = Condition(text, known, PARAMETERS)
    except AgentError:
        return
    assert condition(known).dtype == torch.bool


# --- files -----------------------------------------------------------------------------------------------------------


def test_a_machine_as_it_is_written() -> None:
    made = machine()
    assert [state.name for state in made.states] == ["go", "stay", "on"]
    assert made.states[0].command == Heading("target", "run", 3.0)
    assert made.states[1].command == Clip("guard")
    assert [(t.target, t.condition.text) for t in made.states[1].transitions] == [
        (2, "time_in_state > 0.3"),
        (0, "distance > 5"),
    ]
    assert made.success is not None
    file = MachineFile(MACHINE, "m.yaml")
    assert (file.task, file.arguments, file.seconds, file.heads) == ("location", {"radius": 3.0}, 12.0, True)


def test_parameters_are_set_anew() -> None:
    made = machine(style="walk", ending="roar", stop__roar__walk="2.5")
    assert made.states[0].command == Heading("target", "walk", 1.5)
    assert made.states[0].transitions[0].condition.text == "distance < 2.5"
    assert made.states[1].command == Clip("roar")
    for name, value, part in (
        ("ende", "roar", "did you mean ending"),
        ("stop", "1", "stop.guard, stop.roar"),
        ("ending.roar", "1", "ending alone"),
        ("stop.guard.run", "far", "far is no number"),
        ("stop.guard.run", "nan", "nan is no number"),
        ("stop.guard.crawl", "1", "no such parameter crawl"),
    ):
        with pytest.raises(AgentError, match=part):
            overridden(MachineFile(MACHINE, "m.yaml").parameters, name, value)


@pytest.mark.parametrize(
    ("old", "new", "line", "parts"),
    [
        ("task: location\n", "", 1, ("task: is missing",)),
        ("start: go\n", "", 1, ("start: is missing",)),
        ("start: go", "start: goo", 11, ("no state goo", "did you mean go")),
        ("seconds: 12", "seconds: twelve", 3, ("twelve", "above 0")),
        ("seconds: 12", "seconds: .inf", 3, ("above 0",)),
        ("seconds: 12", "secs: 12", 3, ("no secs", "did you mean seconds")),
        ("arguments: {radius: 3.0}", "arguments: 3", 2, ("arguments: needs entries",)),
        ("  style: run", "  speed: run", 5, ("speed is a quantity",)),
        ("  style: run", "  in: run", 5, ("in is no name",)),
        ("  style: run", "  style: true", 5, ("style: needs a number",)),
        ("  style: run", "  style: crawl", 15, ("no style crawl",)),
        ("guard: {run: 2.0, walk: 1.0}", "guard: {walk: 1.0}", 17, ("no entry run",)),
        ("guard: {run: 2.0, walk: 1.0}", "guard: {run: , walk: 1.0}", 8, ("stop.guard.run: needs a number",)),
        ("success: distance < 1", "success: distanc < 1", 12, ("success: distanc:", "did you mean distance")),
        ("towards: target", "towards: tagret", 15, ("no place tagret", "did you mean target")),
        ("towards: target, ", "", 15, ("towards is missing",)),
        ("style: $style", "style: $stile", 15, ("stile: there is no such parameter", "did you mean style")),
        ("style: $style", "style: $style)", 15, ("cannot be read",)),
        ('speed: "$pace[style]"', "speed: -1", 15, ("speed: -1", "above 0")),
        ('speed: "$pace[style]"', "speed: $style", 15, ("speed: run", "above 0")),
        ("to: stay", "to: stey", 17, ("no state stey", "did you mean stay")),
        ("to: stay", "to: go", 17, ("leads to itself",)),
        ("to: stay, ", "", 17, ("to is missing",)),
        (', when: "distance < stop[ending][style]"', "", 17, ("when is missing",)),
        ('when: "distance < stop[ending][style]"', "when: distance <", 17, ("cannot be read",)),
        ('when: "distance < stop[ending][style]"', "when:", 17, ("when: needs a word",)),
        ("clip: $ending", "clip: gaurd", 19, ("no clip gaurd", "did you mean guard")),
        ("clip: $ending", "clop: guard", 19, ("no clop here", "did you mean clip")),
        ("    clip: $ending\n", "", 18, ("state stay: needs one command",)),
        ("    clip: $ending\n", "    clip: guard\n    heading: {}\n", 18, ("needs one command",)),
        ('      - {to: "on", when: time_in_state > 0.3}\n', "", 22, ("state on: no transition leads here from go",)),
        ("time_in_state > 0.3", "time_in_stat > 0.3", 21, ("did you mean time_in_state",)),
        ("  on:\n", "  stay:\n", 23, ("stay is there twice, first in line 18",)),
        ("  on:\n    clip: kick\n", "  on: kick\n", 23, ("state on: needs entries",)),
        ("    clip: kick", "    clip: |\n      kick\n      kock", 24, ("no clip kick kock",)),
        ("start: go", "start: [go]", 11, ("start: needs a word",)),
        ("start: go", "start: go: stay", 11, ("no YAML",)),
        ("start: go", "start: *go", 11, ("no anchors",)),
        ("radius: 3.0", "radius: !!python/name:os.system ''", 2, ("radius: cannot be read",)),
    ],
)
def test_what_is_wrong_is_told_with_its_line(old: str, new: str, line: int, parts: tuple[str, ...]) -> None:
    assert MACHINE.count(old) == 1
    message = refusal(MACHINE.replace(old, new))
    assert message is not None
    assert message.startswith(f"m.yaml:{line}: "), message
    assert "\n" not in message
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    "text", ["", "# nothing\n", "- a\n- b\n", "a: &a [*a]\n", "task: x\n---\ntask: y\n", "\x00", "{"]
)
def test_what_is_no_machine_at_all(text: str) -> None:
    with pytest.raises(AgentError, match=r"^m\.yaml:\d+: .*$"):
        machine(text)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_a_damaged_file_is_refused_in_one_line_or_is_a_machine(data: st.DataObject) -> None:
    lines = MACHINE.splitlines(keepends=True)
    first = data.draw(st.integers(0, len(lines) - 1))
    last = data.draw(st.integers(first, len(lines)))
    middle = data.draw(st.text(alphabet="gostay:{}[]$ \n-<1.*&!", max_size=12))
    refused = refusal("".join(lines[:first]) + middle + "".join(lines[last:]))
    assert refused is None or re.fullmatch(r"m\.yaml:\d+: .+", refused)


# --- at work ---------------------------------------------------------------------------------------------------------


def test_worlds_go_their_own_ways_and_every_transition_is_logged() -> None:
    execution = Execution(machine(), 3, dt=0.25)
    distances = [[3.0, 3.0, 1.0], [1.9, 2.0, 1.0], [1.0, 2.5, 6.0], [1.0, 1.0, 1.0], [9.0, 1.0, 1.0]]
    states = [execution.step(figures(distance=row, speed=[0.0] * 3)).tolist() for row in distances]
    # a threshold is no part of what is below it; of two that hold, the first is made; 0.3 s are over after two steps
    assert states == [[0, 0, 1], [1, 0, 1], [1, 0, 2], [2, 1, 2], [2, 1, 2]]
    assert execution.changes == [
        Change(2, 0, 0.0, "go", "stay", "distance < 2.0"),
        Change(0, 1, 0.25, "go", "stay", "distance < 2.0"),
        Change(2, 2, 0.5, "stay", "on", "time_in_state > 0.3"),
        Change(0, 3, 0.75, "stay", "on", "time_in_state > 0.3"),
        Change(1, 3, 0.75, "go", "stay", "distance < 2.0"),
    ]


def test_a_world_begins_anew_on_its_own_clock() -> None:
    execution = Execution(machine(), 2, dt=0.25)
    near = figures(distance=[1.0, 1.0], speed=[0.0, 0.0])
    for _ in range(3):
        execution.step(near)
    assert execution.state.tolist() == [2, 2]
    execution.reset(torch.tensor([1]))
    assert execution.state.tolist() == [2, 0]
    known = execution.known(near)
    assert known["time"].tolist() == [0.75, 0.0]
    assert known["time_in_state"].tolist() == [0.25, 0.0]
    execution.step(near)
    assert execution.changes[-1] == Change(1, 3, 0.0, "go", "stay", "distance < 2.0")
