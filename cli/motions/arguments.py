"""Reading `--option value` words, where every mistake is a `CommandError`."""

import argparse
import re
from typing import NoReturn

from murmillo.cli.errors import CommandError, near_names


class Arguments(argparse.ArgumentParser):
    """The options of one command of `murmillo motions`; its help is the module's `HELP`."""

    def __init__(self, command: str) -> None:
        super().__init__(prog=f"murmillo motions {command}", add_help=False, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        raise CommandError(f"{self.prog.removeprefix('murmillo ')}: {message}; `{self.prog} --help` says what it takes")

    def parse(self, words: list[str]) -> argparse.Namespace:
        """The options in these words.

        Raises:
            CommandError: one that is missing, unknown or wrong.
        """
        options, unknown = self.parse_known_args(words)
        if unknown:
            known = [name for action in self._actions for name in action.option_strings]
            cure = near_names(unknown[0], known) if unknown[0].startswith("-") else "put its folder or file first"
            raise CommandError(f"{self.prog.removeprefix('murmillo ')}: {unknown[0]}: there is no such option; {cure}")
        return options


_SETTING = re.compile(r"(?<![^\s(`])(up|unit|fps|groups|character)=")
_PLACE = re.compile(r"^motions=")


def as_options(message: str) -> str:
    """An error of the suite, which names its settings, for a command that takes options: fps=0 becomes --fps=0."""
    return _SETTING.sub(r"--\1=", _PLACE.sub("", message))
