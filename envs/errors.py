"""Errors that a user can mend. Each is one line: the thing, the place, the cure; commands print it and exit with 2."""


class SuiteError(ValueError):
    """A wrong argument, file or combination given to the suite."""


class MotionError(SuiteError):
    """A motion file, folder or clip that cannot be used."""
