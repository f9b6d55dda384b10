"""Machines as files: YAML, checked before anything moves; whatever is wrong is told with its line."""

import keyword
import math
from collections.abc import Callable, Collection, Mapping
from typing import Any, TypeVar

from yaml.nodes import MappingNode, Node, ScalarNode

from murmillo.agents.calm.machine.condition import Condition, picked
from murmillo.agents.calm.machine.machine import (
    OWN_QUANTITIES,
    Clip,
    Heading,
    Machine,
    State,
    Transition,
    Vocabulary,
)
from murmillo.agents.calm.machine.nodes import Document
from murmillo.agents.calm.machine.parameters import Value, near
from murmillo.agents.common.errors import AgentError

_KEYS = ("task", "arguments", "seconds", "parameters", "start", "success", "states")
_NEEDED = ("task", "seconds", "start", "states")
_COMMANDS = ("clip", "heading")

T = TypeVar("T")
_Entries = dict[str, tuple[ScalarNode, Node]]


class MachineFile:
    """A file that describes a machine, read as far as it can be without the names of the world that it is for.

    Attributes:
        task: its name.
        arguments: of the task.
        seconds: that an attempt has [s].
        parameters: with the values that the file gives them.
        heads: whether a state of it goes somewhere, for which a policy of headings is needed.
    """

    def __init__(self, text: str, name: str, reserved: Collection[str] = ()) -> None:
        """
        Args:
            text: of the file.
            name: of the file, for errors.
            reserved: names that no parameter may have, since they mean something else where parameters are set.

        Raises:
            AgentError: the file, the line, what is wrong there and what would be right.
        """
        self._document = document = Document(text, name)
        self._entries = document.entries(document.root, "the machine", _KEYS)
        for key in _NEEDED:
            if key not in self._entries:
                raise document.error(document.root, f"{key}: is missing; a machine has {', '.join(_NEEDED)}")
        self.task = self._text("task")
        self.arguments = self._arguments()
        self.seconds = _positive(document, self._entries["seconds"][1], "seconds", self._text("seconds"))
        self.parameters = self._parameters(reserved)
        self._states = document.entries(self._entries["states"][1], "states")
        if not self._states:
            raise self.error("states", "states: there are none; a state has a name, and clip or heading")
        self._parts = {state: self._state_entries(state, node) for state, (_, node) in self._states.items()}
        self.heads = any("heading" in parts for parts in self._parts.values())

    def error(self, key: str, message: object) -> AgentError:
        """`message` about one of the machine's first keys; about the whole of it where the key is not there."""
        node = self._entries[key][0] if key in self._entries else self._document.root
        return self._document.error(node, message)

    def machine(self, vocabulary: Vocabulary, parameters: Mapping[str, Value] | None = None) -> Machine:
        """The machine for a world with these names.

        Args:
            vocabulary: the names.
            parameters: in place of the file's.

        Raises:
            AgentError: the file, the line, what is wrong there and what would be right.
        """
        reader = _Reader(self._document, vocabulary, self.parameters if parameters is None else parameters)
        for name, (key, _) in self._entries_of("parameters").items():
            if name in reader.quantities:
                raise self._document.error(key, f"parameters: {name} is a quantity of the task; choose another name")
        names = list(self._states)
        states = tuple(reader.state(name, self._parts[name], names) for name in names)
        start = reader.index(self._entries["start"][1], "start", names)
        self._check_reachable(states, start)
        success = self._entries.get("success")
        return Machine(
            states=states,
            start=start,
            success=None if success is None else reader.condition(success[1], "success"),
        )

    def _text(self, key: str) -> str:
        return self._document.text(self._entries[key][1], key)

    def _entries_of(self, key: str) -> _Entries:
        return self._document.entries(self._entries[key][1], key) if key in self._entries else {}

    def _arguments(self) -> dict[str, Any]:
        return {name: self._document.value(node, name) for name, (_, node) in self._entries_of("arguments").items()}

    def _parameters(self, reserved: Collection[str]) -> dict[str, Value]:
        found: dict[str, Value] = {}
        for name, (key, node) in self._entries_of("parameters").items():
            if not name.isidentifier() or keyword.iskeyword(name):
                raise self._document.error(key, f"parameters: {name} is no name; use letters, digits and _")
            if name in reserved:
                raise self._document.error(key, f"parameters: {name} is a setting already; choose another name")
            found[name] = self._parameter(node, name)
        return found

    def _parameter(self, node: Node, what: str) -> Value:
        if isinstance(node, MappingNode):
            entries = self._document.entries(node, what)
            return {name: self._parameter(value, f"{what}.{name}") for name, (_, value) in entries.items()}
        value = self._document.value(node, what)
        if isinstance(value, (int, float)) and not isinstance(value, bool) and not math.isnan(value):
            return float(value)
        if isinstance(value, str) and value.strip():
            return " ".join(value.split())
        raise self._document.error(node, f"{what}: needs a number, a name, or a table of them")

    def _state_entries(self, name: str, node: Node) -> _Entries:
        entries = self._document.entries(node, f"state {name}", (*_COMMANDS, "transitions"))
        if sum(command in entries for command in _COMMANDS) != 1:
            key = self._states[name][0]
            raise self._document.error(key, f"state {name}: needs one command, clip or heading")
        return entries

    def _check_reachable(self, states: tuple[State, ...], start: int) -> None:
        reached, ahead = {start}, [start]
        while ahead:
            for transition in states[ahead.pop()].transitions:
                if transition.target not in reached:
                    reached.add(transition.target)
                    ahead.append(transition.target)
        for number, state in enumerate(states):
            if number not in reached:
                raise self._document.error(
                    self._states[state.name][0],
                    f"state {state.name}: no transition leads here from {states[start].name}; add one, or take it out",
                )


class _Reader:
    """Makes parts of a machine of nodes, with the names of one world at hand."""

    def __init__(self, document: Document, vocabulary: Vocabulary, parameters: Mapping[str, Value]) -> None:
        self.quantities = (*vocabulary.quantities, *OWN_QUANTITIES)
        self._document, self._vocabulary, self._parameters = document, vocabulary, parameters

    def state(self, name: str, parts: _Entries, names: list[str]) -> State:
        """A state; `names` are all states'."""
        command = self._clip(parts["clip"][1]) if "clip" in parts else self._heading(parts["heading"][1])
        nodes = self._document.items(parts["transitions"][1], "transitions") if "transitions" in parts else []
        transitions = tuple(self._transition(node, names) for node in nodes)
        for node, transition in zip(nodes, transitions, strict=True):
            if names[transition.target] == name:
                raise self._document.error(node, f"state {name}: a transition leads to itself; it stays there anyway")
        return State(name, command, transitions)

    def index(self, node: Node, what: str, names: list[str]) -> int:
        """Of a state that is named."""
        return names.index(self._known(self._document.text(node, what), names, node, f"{what}: there is no state"))

    def condition(self, node: Node, what: str) -> Condition:
        text = self._document.text(node, what)
        return self._told(node, what, lambda: Condition(text, self.quantities, self._parameters))

    def _transition(self, node: Node, names: list[str]) -> Transition:
        entries = self._document.entries(node, "transitions", ("to", "when"))
        for key in ("to", "when"):
            if key not in entries:
                raise self._document.error(
                    node, f"transitions: {key} is missing; write - {{to: STATE, when: CONDITION}}"
                )
        return Transition(self.index(entries["to"][1], "to", names), self.condition(entries["when"][1], "when"))

    def _clip(self, node: Node) -> Clip:
        return Clip(self._name(node, "clip", self._vocabulary.clips, "there is no clip"))

    def _heading(self, node: Node) -> Heading:
        entries = self._document.entries(node, "heading", ("towards", "style", "speed"))
        for key in ("towards", "style", "speed"):
            if key not in entries:
                raise self._document.error(node, f"heading: {key} is missing; it has towards, style and speed")
        vocabulary, (_, speed) = self._vocabulary, entries["speed"]
        return Heading(
            towards=self._name(entries["towards"][1], "towards", vocabulary.places, "the task has no place"),
            style=self._name(entries["style"][1], "style", vocabulary.styles, "the policy of headings has no style"),
            speed=_positive(self._document, speed, "speed", self._resolved(speed, "speed")),
        )

    def _name(self, node: Node, what: str, known: tuple[str, ...], there_is_none: str) -> str:
        return self._known(self._resolved(node, what), list(known), node, f"{what}: {there_is_none}")

    def _known(self, name: str, known: list[str], node: Node, there_is_none: str) -> str:
        if name not in known:
            raise self._document.error(node, f"{there_is_none} {name}; {near(name, known)}")
        return name

    def _resolved(self, node: Node, what: str) -> str:
        """What is written there, or the value of the parameter that `$…` picks."""
        text = self._document.text(node, what)
        if not text.startswith("$"):
            return text
        return str(self._told(node, what, lambda: picked(text[1:], self._parameters)))

    def _told(self, node: Node, what: str, make: Callable[[], T]) -> T:
        """What `make` gives; its error told with the line."""
        try:
            return make()
        except AgentError as error:
            raise self._document.error(node, f"{what}: {error}") from None


def _positive(document: Document, node: Node, what: str, text: str) -> float:
    """The text, which `node` stands for, as a number above 0."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise document.error(node, f"{what}: {text} is no number above 0")
    return number
