"""`murmillo motions import`: make clips of motion files, whatever skeleton and format they have."""

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from murmillo.cli.errors import CommandError
from murmillo.cli.motions.arguments import Arguments, as_options

if TYPE_CHECKING:
    from murmillo.cli.motions.convert import Made
    from murmillo.envs.motion import Clip

HELP = """\
murmillo motions import: make clips of motion files

  murmillo motions import recordings/ --to clips/mine
  murmillo motions import walk.bvh run.bvh --to clips/mine --labels from-name
  murmillo motions import 02_01.amc --to clips/mine --character humanoid --up y

  PATH...          files and folders: BVH, Acclaim .amc beside its .asf, AMASS .npz, DeepMimic .txt, AdaptNet .json,
                   ASE .npy, and folders of clips that are to be among the new ones
  --to             needed          folder for the clips
  --character      sword_shield    who is to move: sword_shield or humanoid
  --labels         the name        from-name, or a JSON, YAML or CSV file with a label for each name
  --rule           full            of from-name; see `murmillo motions label --help`
  --map            found out       YAML file that names the skeleton's joints, where none of the known skeletons fits
  --replace        clips that are in the folder may go
  --add            clips that are in the folder stay, but for those whose names come anew

What is found out about each file is printed; what was found out wrongly is told by

  --up y|z         the axis that points up
  --unit m|cm|in   the unit of lengths, or the metres in one as a number
  --fps N          frames a second of the recording
  --drop-rest, --keep-rest     whether a rest pose at the start is left out
  --mirror, --no-mirror        whether left and right are exchanged

Who made the recordings, and what that allows, is kept with the clips and with what is trained on them:

  --source TEXT, --licence TEXT, --redistributable

  --jobs           one a core      processes, 8 at most by default
  --report FILE    write the table of what was done as Markdown

Files that cannot be imported are listed at the end, the others are imported. Exit status 2 where there are none.
"""

FROM_NAME = "from-name"
MAX_JOBS = 8


def run(words: list[str]) -> int:
    """Convert the files and write the clips together at the end, so that breaking it off leaves nothing behind."""
    options = _parse(words)
    from murmillo.cli import runs
    from murmillo.cli.motions import clips, import_table
    from murmillo.cli.motions.convert import Made, Order, convert_all
    from murmillo.envs.character import load_character
    from murmillo.envs.motion import load_clips
    from murmillo.envs.motion.formats.options import ReadOptions
    from murmillo.envs.motion.formats.reader import iter_files

    _check(options)
    character = load_character(options.character)
    told = ReadOptions(options.up, options.unit, options.fps, options.drop_rest, options.mirror)
    saved = [path for path in options.paths if clips.is_saved(path)]
    kept = load_clips(options.to, character) if options.add and clips.is_saved(options.to) else []
    joined = [clip for path in saved for clip in load_clips(path, character)]
    files = [file for path in options.paths if path not in saved for file in iter_files(path)]
    order = Order(options.character, told, Path(options.map) if options.map else None)
    outcomes = convert_all(files, order, options.jobs or _usual_jobs(len(files)))
    failures = [outcome for outcome in outcomes if isinstance(outcome, str)]
    made = _finished([outcome for outcome in outcomes if isinstance(outcome, Made)], options, failures)
    if made:
        _show(made)
    for failure in failures:
        print(f"murmillo: not imported: {as_options(failure)}", file=sys.stderr)
    if not made and not joined:
        if len(failures) != 1:
            print(f"murmillo: none of {len(files)} files could be imported", file=sys.stderr)
        return 2
    if options.report:
        runs.write_text(Path(options.report), import_table.markdown(made, failures))
    clips.save(options.to, _merged(kept, [*joined, *(one.clip for one in made)]))
    return 0


def _parse(words: list[str]) -> argparse.Namespace:
    parser = Arguments("import")
    parser.add_argument("paths", nargs="+", metavar="PATH")
    parser.add_argument("--to", required=True)
    parser.add_argument("--character", default="sword_shield")
    parser.add_argument("--labels")
    parser.add_argument("--rule", default="full")
    parser.add_argument("--map")
    into = parser.add_mutually_exclusive_group()
    into.add_argument("--replace", action="store_true")
    into.add_argument("--add", action="store_true")
    parser.add_argument("--up")
    parser.add_argument("--unit")
    parser.add_argument("--fps", type=float)
    rest = parser.add_mutually_exclusive_group()
    rest.add_argument("--drop-rest", dest="drop_rest", action="store_const", const=True)
    rest.add_argument("--keep-rest", dest="drop_rest", action="store_const", const=False)
    parser.add_argument("--mirror", action=argparse.BooleanOptionalAction)
    parser.add_argument("--source")
    parser.add_argument("--licence")
    parser.add_argument("--redistributable", action="store_true")
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--report")
    return parser.parse(words)


def _check(options: argparse.Namespace) -> None:
    """Refuse what would only be found out after the work was done.

    Raises:
        CommandError, MotionError: a folder, a file of labels, a rule, a map or a number that cannot be used.
    """
    from murmillo.cli.motions import clips
    from murmillo.envs.motion.labels import from_names, read_labels
    from murmillo.envs.motion.retarget.skeleton_map import load_map

    clips.check_folder(options.to, options.replace or options.add)
    if options.labels == FROM_NAME:
        from_names([], options.rule)
    elif options.labels:
        read_labels(options.labels)
    if options.map:
        load_map(Path(options.map))
    if options.jobs is not None and options.jobs < 1:
        raise CommandError(f"--jobs {options.jobs}: needs at least 1")
    if options.report and not Path(options.report).absolute().parent.is_dir():
        raise CommandError(f"--report {options.report}: there is no such folder; name a file in one that exists")


def _usual_jobs(files: int) -> int:
    from murmillo.cli import versions

    return max(1, min(versions.usable_cores(), MAX_JOBS, files))


def _finished(made: "Sequence[Made]", options: argparse.Namespace, failures: list[str]) -> "list[Made]":
    """The clips with labels and terms; one that gets no label goes to the failures."""
    from murmillo.envs.errors import MotionError
    from murmillo.envs.motion.labels import from_file, from_names

    told = {name: value for name in ("source", "licence") if (value := getattr(options, name))}
    if options.redistributable:
        told["redistributable"] = True
    finished = []
    for one in made:
        clip = dataclasses.replace(one.clip, **told)
        try:
            if options.labels == FROM_NAME:
                (clip,) = from_names([clip], options.rule)
            elif options.labels:
                (clip,) = from_file([clip], options.labels)
        except MotionError as error:
            failures.append(str(error))
        else:
            finished.append(dataclasses.replace(one, clip=clip))
    return finished


def _merged(kept: "Sequence[Clip]", new: "Sequence[Clip]") -> "list[Clip]":
    """New clips take the place of kept ones of their name; of new ones that share a name, the later get a number."""
    from murmillo.cli.motions import clips

    named = clips.told_apart(new)
    names = {clip.name.casefold() for clip in named}
    return [*(clip for clip in kept if clip.name.casefold() not in names), *named]


def _show(made: "Sequence[Made]") -> None:
    from murmillo.cli import tables
    from murmillo.cli.motions import import_table

    tables.show(import_table.COLUMNS, import_table.rows(made), import_table.LEFT)
    for name, text in import_table.common_findings(made).items():
        print(import_table.described(name, text))
    print(import_table.MEANING)
