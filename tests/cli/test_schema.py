"""Dataclasses become schemas and come back as they were."""

from dataclasses import dataclass, field
from typing import Literal

import pytest
from omegaconf import OmegaConf
from omegaconf.errors import ValidationError

from murmillo.cli.errors import CommandError
from murmillo.cli.schema import build, schema_of


@dataclass
class Inner:
    mode: Literal["a", "b"] = "a"
    pair: tuple[float, float] = (1.0, 2.0)


@dataclass
class Outer:
    needed: int
    inner: Inner = field(default_factory=lambda: Inner(mode="b"))
    sizes: tuple[int, ...] = (3, 4)
    limit: float | None = None


def checked(*words: str) -> Outer:
    values = OmegaConf.merge(OmegaConf.structured(schema_of(Outer)), OmegaConf.from_dotlist(list(words)))
    return build(Outer, OmegaConf.to_container(values, enum_to_str=True))  # type: ignore[arg-type]


def test_defaults_and_values_come_back_with_their_types() -> None:
    assert checked("needed=1") == Outer(1, Inner("b"), (3, 4), None)
    assert checked("needed=1", "inner.mode=a", "sizes=[5]", "limit=2") == Outer(1, Inner("a"), (5,), 2.0)


def test_a_default_is_made_anew_for_each_schema() -> None:
    first, second = schema_of(Outer)(), schema_of(Outer)()
    assert first.inner is not second.inner


def test_values_outside_a_literal_are_refused() -> None:
    with pytest.raises(ValidationError, match=r"'c', expected one of \[a, b\]"):
        checked("needed=1", "inner.mode=c")


def test_a_tuple_of_another_length_is_refused() -> None:
    with pytest.raises(CommandError, match=r"inner\.pair: 3 values, but it takes 2"):
        checked("needed=1", "inner.pair=[1,2,3]")
