"""`murmillo compare`: put runs side by side."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from murmillo.cli.errors import CommandError

if TYPE_CHECKING:
    from murmillo.cli.comparison.grouping import Group

HELP = """\
murmillo compare: put runs side by side

  murmillo compare runs/a runs/b                     tables and learning curves, as comparisons/<time>/comparison.md
  murmillo compare 'runs/sweep-*'                    all runs of that name
  murmillo compare runs/* out=ase_and_calm           into a folder of your choice

  RUN …     needed                folders of runs; * and ? stand for any letters
  out       comparisons/<time>    folder of the page and its pictures

Runs that differ in their seed alone make a group: its figures are interquartile means with a 95 % bootstrap interval.
What cannot be compared with the first group (other clips, character, networks or number of samples) is shown and marked
so. To get seeds and methods:

  murmillo train --multirun agent=ase,calm,case seed=1,2,3,4,5 run.root=runs/methods
  murmillo compare 'runs/methods/*'
"""

_PAGE = "comparison.md"
_WILD = "*?["


@dataclass
class CompareConfig:
    """The settings of `murmillo compare`; see `HELP`."""

    out: str | None = None


def run(words: list[str]) -> int:
    """Read the runs, print a table and write the page with its pictures."""
    import time

    from murmillo.cli import config as configuration
    from murmillo.cli import runs, tables
    from murmillo.cli.comparison import curves, page, table

    settings = configuration.parse(CompareConfig, [word for word in words if is_setting(word)])
    out = Path(settings.out or f"comparisons/{time.strftime('%Y-%m-%d_%H-%M-%S')}")
    if any(part.exists() and not part.is_dir() for part in (out, *out.parents)):
        raise CommandError(f"out={out}: this is a file, or lies in one; name a folder")
    groups, left_out = gather(folders([word for word in words if not is_setting(word)]))
    figures = table.tabulate(groups)
    out.mkdir(parents=True, exist_ok=True)
    runs.write_text(out / _PAGE, page.page(groups, left_out, figures, curves.plot_all(groups, out)))
    columns, rows = page.summary_table(groups, figures)
    tables.show(columns, rows, left=("group", "comparable"))
    for folder, reason in left_out:
        print(f"left out: {folder} {reason}")
    print(f"written: {out / _PAGE}")
    return 0


def folders(words: list[str], command: str = "compare") -> list[Path]:
    """Folders of the runs that the words name, each once, in their order.

    Raises:
        CommandError: there is no such run, nothing has a name like this, or there is no word.
    """
    import glob

    from murmillo.cli import runs

    if not words:
        raise CommandError(f"{command} needs at least one run: murmillo {command} runs/<name> runs/<name>, or 'runs/*'")
    found: dict[Path, Path] = {}
    for word in words:
        if word.startswith("-"):
            raise CommandError(f"{word}: there is no such option; runs are named by their folders")
        named = [word]
        if any(letter in word for letter in _WILD) and not Path(word).exists():
            named = [path for path in sorted(glob.glob(word)) if (Path(path) / runs.CONFIG).is_file()]
            if not named:
                raise CommandError(f"{word}: there is no run with a name like this")
        for path in named:
            folder = runs.existing(path, "run")
            found.setdefault(folder.resolve(), folder)
    return list(found.values())


def gather(paths: list[Path]) -> tuple[list["Group"], list[tuple[Path, str]]]:
    """The runs in groups, and what is left out with the reason.

    Raises:
        CommandError: a run cannot be read, or none of them finished an iteration.
    """
    from murmillo.cli.comparison.grouping import group
    from murmillo.cli.comparison.record import read

    read_runs = {path: read(path) for path in paths}
    left_out = [(path, "never finished an iteration") for path, one in read_runs.items() if one is None]
    if len(left_out) == len(paths):
        raise CommandError(f"{paths[0]}: never finished an iteration, nor did another of these runs; train one first")
    groups, repeated = group(one for one in read_runs.values() if one is not None)
    return groups, left_out + [(one.folder, reason) for one, reason in repeated]


def is_setting(word: str) -> bool:
    """Names of runs may have an equals sign too."""
    name, equals, _ = word.partition("=")
    return bool(equals) and name.isidentifier() and not Path(word).exists()
