"""Tables on the terminal that nothing is cut off from when they go into a file."""

import sys
from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.table import Table

_WIDE = 10_000


def show(columns: Sequence[str], rows: Iterable[Sequence[str]], left: Sequence[str]) -> None:
    """Print a table; the columns named in `left` are aligned left, the others, which hold figures, right."""
    table = Table(box=None, pad_edge=False)
    for column in columns:
        table.add_column(column, justify="left" if column in left else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    # a file has no width, and a terminal's is no reason to hide a name
    Console(width=None if sys.stdout.isatty() else _WIDE, highlight=False, markup=False).print(table)
