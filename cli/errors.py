"""What a user can mend, told in one line: the thing, the place, the cure. No traceback, exit status 2."""

from difflib import get_close_matches


class CommandError(Exception):
    """A wrong word on the command line, a wrong value in a configuration, or a run folder that cannot be used."""


def user_errors() -> tuple[type[Exception], ...]:
    """The errors of all rooms that a user can mend. They are imported late, so that `--help` answers at once."""
    from murmillo.agents.common.errors import AgentError
    from murmillo.envs.errors import SuiteError

    return CommandError, AgentError, SuiteError


def near_names(name: str, known: list[str]) -> str:
    """The end of a sentence: the known names that look like `name`, or all of them where none does."""
    near = get_close_matches(name, known, n=3, cutoff=0.6)
    return f"did you mean {' or '.join(near)}?" if near else f"known are: {', '.join(sorted(known)) or 'none'}"
