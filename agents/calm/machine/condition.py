"""Conditions such as `distance < stop[style] and not speed > 0.5`: compiled from a small part of Python's grammar."""

import ast
import operator
import warnings
from collections.abc import Callable, Collection, Mapping
from functools import reduce
from itertools import pairwise

import torch
from torch import Tensor

from murmillo.agents.calm.machine.parameters import Value, look_up, near
from murmillo.agents.common.errors import AgentError

Quantities = Mapping[str, Tensor]
"""Named figures of N worlds, each `[N]`."""

_DEEPEST = 20
"""Levels of an expression; what is nested without end no recursion survives."""
_COMPARISONS: dict[type, Callable[..., Tensor]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_FORM = "write comparisons such as distance < 1.5, joined by and, or, not"

_Holds = Callable[[Quantities], Tensor]


class Condition:
    """A condition, true or false in each world.

    Attributes:
        text: with the numbers of the parameters in their place.
    """

    def __init__(self, text: str, quantities: Collection[str], parameters: Mapping[str, Value]) -> None:
        """
        Args:
            text: comparisons by <, <=, >, >= of quantities with numbers and with each other, joined by and, or, not.
            quantities: names that there are.
            parameters: names of numbers, and of tables that numbers are picked from.

        Raises:
            AgentError: it is no such text, or a name is not known.
        """
        tree = _Numbers(quantities, parameters).visit(_expression(text))
        self.text = ast.unparse(tree)
        self._holds = _condition(tree)

    def __call__(self, quantities: Quantities) -> Tensor:
        """[N] bool."""
        return self._holds(quantities)


def picked(text: str, parameters: Mapping[str, Value]) -> str | float:
    """What the text picks of the parameters, as in `look_up`.

    Raises:
        AgentError: it cannot be read, or picks nothing.
    """
    return look_up(_expression(text), parameters)


class _Numbers(ast.NodeTransformer):
    """Puts numbers in the place of parameters."""

    def __init__(self, quantities: Collection[str], parameters: Mapping[str, Value]) -> None:
        self._quantities, self._parameters = quantities, parameters

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self._quantities:
            return node
        if node.id not in self._parameters:
            known = [*self._quantities, *self._parameters]
            raise AgentError(f"{node.id}: there is no such quantity or parameter; {near(node.id, known)}")
        return self._number(node)

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        return self._number(node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        return self._number(node)

    def _number(self, node: ast.expr) -> ast.expr:
        number = look_up(node, self._parameters)
        if isinstance(number, str):
            raise AgentError(f"{ast.unparse(node)}: is the name {number}, where a number is needed")
        return ast.Constant(number)


def _condition(node: ast.expr) -> _Holds:
    match node:
        case ast.BoolOp(op=op, values=values):
            join = torch.logical_and if isinstance(op, ast.And) else torch.logical_or
            parts = [_condition(value) for value in values]
            return lambda known: reduce(join, (part(known) for part in parts))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            part = _condition(operand)
            return lambda known: ~part(known)
        case ast.Compare(left=left, ops=ops, comparators=others):
            return _comparison(node, [left, *others], ops)
        case _:
            raise AgentError(f"{ast.unparse(node)}: is no comparison; {_FORM}")


def _comparison(node: ast.Compare, operands: list[ast.expr], ops: list[ast.cmpop]) -> _Holds:
    """True where all neighbours compare so: `0 < approach < 1` is one comparison."""
    if any(type(op) not in _COMPARISONS for op in ops):
        raise AgentError(f"{ast.unparse(node)}: figures are compared by <, <=, >, >= only")
    sides = list(pairwise(_operand(operand) for operand in operands))
    if any(isinstance(left, float) and isinstance(right, float) for left, right in sides):
        raise AgentError(f"{ast.unparse(node)}: compares numbers, and none of the quantities; {_FORM}")
    steps = [(_COMPARISONS[type(op)], left, right) for op, (left, right) in zip(ops, sides, strict=True)]

    def value(operand: str | float, known: Quantities) -> Tensor | float:
        return known[operand] if isinstance(operand, str) else operand

    return lambda known: reduce(
        torch.logical_and, (compare(value(left, known), value(right, known)) for compare, left, right in steps)
    )


def _operand(node: ast.expr) -> str | float:
    """A quantity's name, or a number."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return float(number)
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant() as positive):
            number = _operand(positive)
            assert isinstance(number, float)
            return -number
        case _:
            raise AgentError(f"{ast.unparse(node)}: is neither a quantity nor a number; {_FORM}")


def _expression(text: str) -> ast.expr:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", SyntaxWarning)
            tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise AgentError(f"{text!r}: cannot be read; {_FORM}") from None
    level, depth = [tree], 0
    while level:
        level, depth = [child for node in level for child in ast.iter_child_nodes(node)], depth + 1
    if depth > _DEEPEST:
        raise AgentError(f"this is nested {depth} levels deep, where {_DEEPEST} are the most; use more transitions")
    return tree
