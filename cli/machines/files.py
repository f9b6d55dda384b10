"""The machine that `machine=…` names, with the parameters that the other words set."""

import dataclasses
import os
from importlib.resources import files
from pathlib import Path
from typing import TypeVar

from murmillo.agents.calm.machine.parameters import Value, overridden
from murmillo.agents.calm.machine.reading import MachineFile
from murmillo.agents.common.errors import AgentError
from murmillo.cli.config import parse
from murmillo.cli.errors import CommandError, near_names
from murmillo.cli.tasks.words import value_of

_SUFFIX = ".yaml"

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class Chosen:
    """A machine's file, and what it is to be made with.

    Attributes:
        word: as the user named it.
        stem: name of the file without its ending.
        file: read.
        parameters: the file's with those of the command line laid over them.
    """

    word: str
    stem: str
    file: MachineFile
    parameters: dict[str, Value]

    @property
    def variant(self) -> str:
        """The file and the names among its parameters, such as location-walk_forward-roar-pack."""
        names = [value for value in self.parameters.values() if isinstance(value, str)]
        return "-".join(Path(name).name for name in (self.stem, *names))


def shipped() -> list[str]:
    """Names of the machines that come with the package."""
    found = files("murmillo.conf.machines").iterdir()
    return sorted(path.name.removesuffix(_SUFFIX) for path in found if path.name.endswith(_SUFFIX))


def choose(cls: type[T], words: list[str]) -> tuple[T, Chosen]:
    """The settings of a command and the machine, of words of which some set its parameters.

    Args:
        cls: dataclass of the settings, one of which is `machine`.

    Raises:
        CommandError: a word that is neither a setting nor a parameter, a value that cannot be, or no such machine.
        AgentError: the machine's file is wrong; it names the line.
    """
    settings = [field.name for field in dataclasses.fields(cls)]  # type: ignore[arg-type]  which a T cannot say
    word = value_of(words, "machine") or ""
    file = _read(word, settings)
    parameters: dict[str, Value] = file.parameters
    others = []
    for setting in words:
        name, equals, text = setting.partition("=")
        if not equals or name in settings:
            others.append(setting)
        elif name.partition(".")[0] in parameters:
            try:
                parameters = overridden(parameters, name, text)
            except AgentError as error:
                raise CommandError(f"{setting}: {error}") from None
        else:
            near = near_names(name, [*settings, *parameters])
            raise CommandError(f"{name}: this is no setting, and no parameter of machine={word}; {near}")
    return parse(cls, others), Chosen(word, Path(word).stem, file, parameters)


def _read(word: str, reserved: list[str]) -> MachineFile:
    if word.endswith((_SUFFIX, ".yml")) or os.sep in word:
        try:
            text = Path(word).read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) and error.strerror else error
            raise CommandError(f"machine={word}: cannot be read ({reason}); name a YAML file, or {_names()}") from None
        return MachineFile(text, word, reserved)
    if word not in shipped():
        raise CommandError(f"machine={word}: no such machine; name a YAML file (docs/machines.md), or {_names()}")
    path = files("murmillo.conf.machines").joinpath(word + _SUFFIX)
    return MachineFile(path.read_text(encoding="utf-8"), path.name, reserved)


def _names() -> str:
    return " or ".join(shipped())
