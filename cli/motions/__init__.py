"""`murmillo motions`: bring in motion clips, look at them, change them. Each of its commands is a module here."""

import importlib
import sys
from types import ModuleType

from murmillo.cli.errors import CommandError, near_names

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


def choose(words: list[str]) -> tuple[ModuleType, list[str]]:
    """The module of the command that the words begin with, and the words that are left for it.

    Raises:
        CommandError: there is no such command.
    """
    if not words or words[0] in ("--help", "-h"):
        return sys.modules[__name__], ["--help"]
    name, *rest = words
    if name not in COMMANDS:
        raise CommandError(f"motions {name}: there is no such command; {near_names(name, list(COMMANDS))}")
    return importlib.import_module(f"{__name__}.{COMMANDS[name]}"), rest
