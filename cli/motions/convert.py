"""Motion files to clips, several at a time. Nothing is written here, so breaking it off leaves nothing behind."""

import multiprocessing
import signal
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import file_digest
from pathlib import Path

import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from murmillo.cli.errors import CommandError
from murmillo.envs.character import Character, load_character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion import Clip
from murmillo.envs.motion.formats.options import ReadOptions
from murmillo.envs.motion.formats.reader import ListedFile, read_file
from murmillo.envs.motion.retarget.fit import Fit
from murmillo.envs.motion.retarget.retargeting import retarget


@dataclass(frozen=True)
class Order:
    """What is to be done with every file; `skeleton_map` is None where the map is to be found out."""

    character: str
    options: ReadOptions
    skeleton_map: Path | None


@dataclass(frozen=True)
class Made:
    """A clip, how it came about, and what was found out about its file."""

    clip: Clip
    fit: Fit
    findings: dict[str, str]


def convert(listed: ListedFile, order: Order) -> Made | str:
    """Read one file and retarget what it holds; a line that says what is wrong where that cannot be done."""
    try:
        recording = read_file(listed, order.options)
        with listed.path.open("rb") as stream:
            origin = file_digest(stream, "sha256").hexdigest()
        clip, fit = retarget(recording, _character(order.character), order.skeleton_map)
    except MotionError as error:
        return _about(listed.path, str(error))
    except Exception as error:  # a defect of ours; the user's other files must not suffer from it
        return _about(listed.path, f"murmillo fails on this file ({type(error).__name__}: {error}); please report it")
    return Made(replace(clip, origin=origin), fit, recording.findings)


def _about(file: Path, text: str) -> str:
    """One line that names the file: a reader's error does, that of the retargeting names only the recording."""
    place, text = ("".join(char if char.isprintable() else "?" for char in part) for part in (str(file), text))
    return text if place in text else f"{place}: {text.removeprefix(f'{file.stem}: ')}"


def convert_all(files: Sequence[ListedFile], order: Order, jobs: int) -> list[Made | str]:
    """Convert the files in `jobs` processes, in this one where it is 1; a bar shows how far it is.

    Returns:
        What became of each file, in their order.

    Raises:
        CommandError: the system ended one of the processes.
    """
    outcomes: dict[int, Made | str] = {}
    with _bar() as bar:
        task = bar.add_task("importing", total=len(files))
        for index, outcome in _in_turn(files, order) if jobs == 1 else _in_processes(files, order, jobs):
            outcomes[index] = outcome
            bar.advance(task)
    return [outcomes[index] for index in range(len(files))]


def _in_turn(files: Sequence[ListedFile], order: Order) -> Iterator[tuple[int, Made | str]]:
    for index, file in enumerate(files):
        yield index, convert(file, order)


def _in_processes(files: Sequence[ListedFile], order: Order, jobs: int) -> Iterator[tuple[int, Made | str]]:
    # forked processes would inherit the locks of torch's threads
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _begin)
    try:
        running: dict[Future[Made | str], int] = {
            pool.submit(convert, file, order): index for index, file in enumerate(files)
        }
        for done in as_completed(running):
            yield running[done], done.result()
    except BrokenProcessPool:
        raise CommandError(
            "import: the system ended a process that converted files, as it does where memory runs out; "
            "use fewer with --jobs 1"
        ) from None
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _begin() -> None:
    """A process of the pool computes with one thread, and ends at once when the user presses Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    torch.set_num_threads(1)


@lru_cache(maxsize=1)
def _character(name: str) -> Character:
    return load_character(name)


def _bar() -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty())
