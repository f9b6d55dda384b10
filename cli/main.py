"""The command `murmillo`: chooses the subcommand and turns a user's mistake into one line and exit status 2."""

import importlib
import os
import sys

from murmillo.cli.errors import CommandError, near_names, user_errors
from murmillo.cli.interrupts import BROKEN_OFF, STATUS, interruptible

HELP = """\
murmillo: simulated sword-and-shield fighters that learn skills from motion clips

  murmillo train      train an agent and leave a report, a video and checkpoints in runs/<name>/
  murmillo evaluate   measure a trained agent:       murmillo evaluate run=runs/<name>
  murmillo compare    put runs side by side:         murmillo compare 'runs/*'
  murmillo record     film a trained agent:          murmillo record run=runs/<name>
  murmillo play       steer it in a browser:         murmillo play run=runs/<name>
  murmillo merge      make one network of an adapted policy: murmillo merge run=runs/<name> into=runs/<new>
  murmillo map        draw the latents of AdaptNet:  murmillo map runs/<base> runs/<style>
  murmillo motions    import motion clips, look at them, label them
  murmillo bench      measure how fast this machine trains
  murmillo doctor     look at this machine: versions, graphics, threads, GPU, speed

`murmillo <command> --help` says what a command takes. Settings are written name=value.
"""

COMMANDS = ("train", "evaluate", "compare", "record", "play", "merge", "map", "motions", "bench", "doctor")


def main(argv: list[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 2 for a mistake that the user can mend, 130 broken off.

    141, as the shell has it, where standard output was closed before its end.
    """
    words = sys.argv[1:] if argv is None else argv
    if not words or words[0] in ("--help", "-h", "help"):
        print(HELP, end="")
        return 0
    try:
        with interruptible():
            status = _run(words[0], words[1:])
        sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        print(BROKEN_OFF, file=sys.stderr)
        return STATUS
    except BrokenPipeError:  # who reads has read enough: `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes what is left when it ends
        return 141
    except user_errors() as error:
        print(f"murmillo: {error}", file=sys.stderr)
        return 2


def _run(name: str, words: list[str]) -> int:
    if name not in COMMANDS:
        raise CommandError(f"there is no command {name!r}; {near_names(name, list(COMMANDS))}")
    module = importlib.import_module(f"murmillo.cli.{name}")
    if hasattr(module, "choose"):  # it has commands of its own
        module, words = module.choose(words)
    if "--help" in words or "-h" in words:
        print(module.HELP, end="")
        return 0
    importlib.import_module("murmillo.envs")  # before torch and mujoco, whose threads and graphics it sees to
    return module.run(words)


if __name__ == "__main__":
    sys.exit(main())
