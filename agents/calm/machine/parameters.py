"""The parameters of a machine: numbers, names, and tables of them that other parameters pick from."""

import ast
import math
from collections.abc import Mapping
from difflib import get_close_matches

from murmillo.agents.common.errors import AgentError

Value = str | float | dict[str, "Value"]
"""A name, a number, or a table of these."""


def near(name: str, known: list[str]) -> str:
    """The end of a sentence: the known names that look like `name`, or all of them where none does."""
    found = get_close_matches(name, known, n=3, cutoff=0.6)
    return f"did you mean {' or '.join(found)}?" if found else f"known are: {', '.join(sorted(known)) or 'none'}"


def look_up(node: ast.expr, parameters: Mapping[str, Value]) -> str | float:
    """What an expression such as `reach[attack].stop` picks: a table's entry, by another parameter's value or by name.

    Raises:
        AgentError: there is no such parameter or entry, or it is a table still.
    """
    value = _pick(node, parameters)
    if isinstance(value, dict):
        raise AgentError(
            f"{ast.unparse(node)}: this is a table of {', '.join(value)}; pick one: {ast.unparse(node)}[…]"
        )
    return value


def overridden(parameters: Mapping[str, Value], name: str, text: str) -> dict[str, Value]:
    """The parameters with one of them set anew, which keeps its kind.

    Args:
        parameters: of the machine; they stay as they are.
        name: dotted, such as "slow" or "stop.roar.run_forward".
        text: its new value.

    Raises:
        AgentError: there is none of that name, it is a table, or the text is no number where one is needed.
    """
    first, _, rest = name.partition(".")
    if first not in parameters:
        raise AgentError(f"there is no such parameter {first}; {near(first, list(parameters))}")
    old = parameters[first]
    if isinstance(old, dict) != bool(rest):
        entries = ", ".join(f"{first}.{entry}" for entry in old) if isinstance(old, dict) else f"{first} alone"
        raise AgentError(f"{name}: {first} is {'a table' if isinstance(old, dict) else 'no table'}; write {entries}")
    return {**parameters, first: overridden(old, rest, text) if isinstance(old, dict) else _like(old, text)}


def _like(old: str | float, text: str) -> str | float:
    if isinstance(old, str):
        return text
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise AgentError(f"{text} is no number, which is needed here")
    return number


def _pick(node: ast.expr, parameters: Mapping[str, Value]) -> Value:
    match node:
        case ast.Name(id=name):
            if name not in parameters:
                raise AgentError(f"{name}: there is no such parameter; {near(name, list(parameters))}")
            return parameters[name]
        case ast.Subscript(value=inner, slice=index):
            return _entry(node, inner, str(look_up(index, parameters)), parameters)
        case ast.Attribute(value=inner, attr=name):
            return _entry(node, inner, name, parameters)
        case _:
            raise AgentError(f"{ast.unparse(node)}: is neither a parameter nor an entry of one")


def _entry(node: ast.expr, inner: ast.expr, entry: str, parameters: Mapping[str, Value]) -> Value:
    table = _pick(inner, parameters)
    if not isinstance(table, dict):
        raise AgentError(f"{ast.unparse(node)}: {ast.unparse(inner)} is no table to pick from")
    if entry not in table:
        raise AgentError(f"{ast.unparse(node)}: the table has no entry {entry}; {near(entry, list(table))}")
    return table[entry]
