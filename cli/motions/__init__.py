"""`murmillo motions`: bring in motion clips, look at them, change them. Each of its commands is a module here."""

import importlib
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from murmillo.cli.errors import CommandError, near_names, user_errors
from murmillo.cli.motions.arguments import as_options

HELP = """\
murmillo motions: clips to learn from

  murmillo motions import     make clips of BVH, Acclaim, AMASS, DeepMimic, AdaptNet and ASE files
  murmillo motions list       what is in a folder of clips, or in the built-in pack
  murmillo motions inspect    measure clips and name what is suspicious, with the frame
  murmillo motions preview    draw clips: contact sheets and films
  murmillo motions trim       cut a clip
  murmillo motions mirror     add clips with left and right exchanged
  murmillo motions label      give clips skill labels: by name, file, similarity, example or chance

`murmillo motions <command> --help` says what a command takes. Train on a folder of clips with
`murmillo train motions=<folder>`.
"""

COMMANDS = {
    "import": "import_clips",
    "list": "list_clips",
    "inspect": "inspect_clips",
    "preview": "preview",
    "trim": "trim",
    "mirror": "mirror",
    "label": "label",
}


class Command(NamedTuple):
    """What a module of a command has."""

    HELP: str
    run: Callable[[list[str]], int]


def choose(words: list[str]) -> tuple[Command, list[str]]:
    """The command that the words begin with, and the words that are left for it.

    Raises:
        CommandError: there is no such command.
    """
    if not words or words[0] in ("--help", "-h"):
        return Command(HELP, lambda words: 0), ["--help"]
    name, *rest = words
    if name not in COMMANDS:
        raise CommandError(f"motions {name}: there is no such command; {near_names(name, list(COMMANDS))}")
    module = importlib.import_module(f"{__name__}.{COMMANDS[name]}")
    return Command(module.HELP, partial(_run, module.run)), rest


def _run(run: Callable[[list[str]], int], words: list[str]) -> int:
    try:
        return run(words)
    except user_errors() as error:
        raise CommandError(as_options(str(error))) from None
