"""YAML with the line numbers kept, so that whatever is wrong can be found."""

from collections.abc import Sequence
from typing import Any

import yaml
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from murmillo.agents.calm.machine.parameters import near
from murmillo.agents.common.errors import AgentError


class Document:
    """One YAML document, read a node at a time.

    Attributes:
        root: its outermost node.
    """

    def __init__(self, text: str, name: str) -> None:
        """
        Args:
            text: of the file.
            name: of the file, for errors.

        Raises:
            AgentError: it is no YAML, or none of a single document; it uses anchors, or has nothing in it.
        """
        self._name = name
        try:
            for event in yaml.parse(text, yaml.SafeLoader):
                if isinstance(event, yaml.AliasEvent):  # it could stand for itself, or for all memory that there is
                    raise self.error(event, f"*{event.anchor}: machines have no anchors; write it out")
            self._loader = yaml.SafeLoader(text)
            root = self._loader.get_single_node()
        except yaml.MarkedYAMLError as error:
            line = error.problem_mark.line + 1 if error.problem_mark else 1
            raise AgentError(f"{name}:{line}: no YAML that can be read: {error.problem or error.context}") from None
        except (yaml.YAMLError, RecursionError) as error:
            reason = str(error).splitlines()[0]
            raise AgentError(f"{name}:1: no YAML that can be read: {reason}") from None
        if root is None:
            raise AgentError(f"{name}:1: the file is empty; a machine has task, start and states")
        self.root: Node = root

    def error(self, place: Node | yaml.Event, message: object) -> AgentError:
        """`message` about what is written at `place`."""
        return AgentError(f"{self._name}:{place.start_mark.line + 1}: {message}")

    def entries(self, node: Node, what: str, known: Sequence[str] = ()) -> dict[str, tuple[ScalarNode, Node]]:
        """Keys and values of a mapping by name; of the `known` keys only, if there are any.

        Raises:
            AgentError: it is no mapping, a key comes twice, or is not known; `what` names the mapping.
        """
        if not isinstance(node, MappingNode):
            raise self.error(node, f"{what}: needs entries, name: value")
        found: dict[str, tuple[ScalarNode, Node]] = {}
        for key, value in node.value:
            name = self.text(key, f"a name in {what}")
            if name in found:
                first = found[name][0].start_mark.line + 1
                raise self.error(
                    key, f"{what}: {name} is there twice, first in line {first}; take one out or rename it"
                )
            if known and name not in known:
                raise self.error(key, f"{what}: there is no {name} here; {near(name, list(known))}")
            found[name] = key, value
        return found

    def items(self, node: Node, what: str) -> list[Node]:
        """What a list holds."""
        if not isinstance(node, SequenceNode):
            raise self.error(node, f"{what}: needs a list, each line of it begun by -")
        return node.value

    def text(self, node: Node, what: str) -> str:
        """A word or a line as it is written, spaces made single: `on` is no truth value here."""
        if not isinstance(node, ScalarNode) or not node.value.strip():
            raise self.error(node, f"{what}: needs a word or a line of text")
        return " ".join(node.value.split())

    def value(self, node: Node, what: str) -> Any:
        """Whatever plain YAML is written there."""
        try:
            return self._loader.construct_document(node)
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            reason = getattr(error, "problem", None) or str(error).splitlines()[0]
            raise self.error(node, f"{what}: cannot be read: {reason}") from None
