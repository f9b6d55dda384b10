"""Dataclasses to OmegaConf's schemas and back, so that each class keeps one plain configuration with exact types.

OmegaConf knows no `Literal`, and gives lists for tuples: the schema is a twin in which a `Literal` is an enumeration,
and `build` makes the true dataclass of a checked configuration.
"""

import copyreg
import dataclasses
import types
from collections.abc import Sequence
from enum import Enum
from functools import cache
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from omegaconf import MISSING

from murmillo.cli.errors import CommandError, near_names

T = TypeVar("T")

# dataclasses know a missing default by its identity, which must outlast the way to the processes of a sweep and back
copyreg.pickle(type(dataclasses.MISSING), lambda missing: "MISSING")


@cache
def schema_of(cls: type) -> type:
    """The twin of the dataclass `cls` that OmegaConf can check values against; a field without default is mandatory."""
    hints = get_type_hints(cls)
    fields: list[tuple[str, Any, Any]] = []
    for field in dataclasses.fields(cls):
        hint = _schema_type(hints[field.name])
        fields.append((field.name, hint, dataclasses.field(default_factory=_Default(field, hint))))
    return dataclasses.make_dataclass(cls.__name__, fields)


def twin_of(value: Any) -> Any:
    """The dataclass `value` as an instance of its twin."""
    return _schema_value(value, schema_of(type(value)))


class _Default:
    """Makes the default of a field anew for each instance, as the twin's type."""

    def __init__(self, field: dataclasses.Field, hint: Any) -> None:
        self.field, self.hint = field, hint

    def __call__(self) -> Any:
        if self.field.default_factory is not dataclasses.MISSING:
            return _schema_value(self.field.default_factory(), self.hint)
        return MISSING if self.field.default is dataclasses.MISSING else _schema_value(self.field.default, self.hint)


class _Choice(Enum):
    """A value of a `Literal`; other settings may be put together from it."""

    def __str__(self) -> str:
        return self.value


@cache
def _enumeration(values: tuple[str, ...]) -> type[Enum]:
    return _Choice("Choice", {value: value for value in values})  # type: ignore[return-value]


def _schema_type(hint: Any) -> Any:
    if dataclasses.is_dataclass(hint):
        return schema_of(hint)  # type: ignore[arg-type]
    if get_origin(hint) is Literal:
        return _enumeration(get_args(hint))
    if get_origin(hint) is Sequence:  # its items are checked by what they are for
        return list[Any]
    inner = _optional(hint)
    return hint if inner is None else _schema_type(inner) | None


def _schema_value(value: Any, hint: Any) -> Any:
    """The default `value` as the twin's type `hint` has it."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        twin = schema_of(type(value))
        hints = get_type_hints(twin)
        return twin(**{f.name: _schema_value(getattr(value, f.name), hints[f.name]) for f in dataclasses.fields(value)})
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint[str(value)]
    return value


def _optional(hint: Any) -> Any:
    """X of `X | None`, else None."""
    if get_origin(hint) not in (Union, types.UnionType):
        return None
    inner = [part for part in get_args(hint) if part is not type(None)]
    return inner[0] if len(inner) == 1 else None


def build(cls: type[T], values: dict[str, Any], prefix: str = "") -> T:
    """The dataclass `cls` of plain checked values (`OmegaConf.to_container(..., enum_to_str=True)`).

    Raises:
        CommandError: a name that `cls` has not, or a tuple of another length; the message puts `prefix` before names.
    """
    hints = get_type_hints(cls)
    for name in values.keys() - hints.keys():
        raise CommandError(f"{prefix}{name}: there is no such setting; {near_names(name, list(hints))}")
    return cls(**{name: _build_value(hints[name], value, prefix + name) for name, value in values.items()})


def _build_value(hint: Any, value: Any, name: str) -> Any:
    hint = _optional(hint) or hint
    if value is None:
        return None
    if dataclasses.is_dataclass(hint):
        return value if dataclasses.is_dataclass(value) else build(hint, value, f"{name}.")  # type: ignore[arg-type]
    if get_origin(hint) is not tuple:
        return value
    items = get_args(hint)
    if Ellipsis not in items and len(value) != len(items):
        raise CommandError(f"{name}: {len(value)} values, but it takes {len(items)}")
    return tuple(value)
