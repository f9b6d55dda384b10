"""`murmillo motions label`: give clips skill labels."""

import argparse
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from murmillo.cli.errors import CommandError
from murmillo.cli.motions.arguments import Arguments

if TYPE_CHECKING:
    from murmillo.envs.character import Character
    from murmillo.envs.motion import Clip

HELP = """\
murmillo motions label: give clips skill labels

  murmillo motions label clips/mine --by from-name --to clips/labelled
  murmillo motions label clips/mine --by file --file labels.csv --to clips/labelled
  murmillo motions label clips/mine --by cluster --groups 12 --to clips/labelled
  murmillo motions label clips/mine --by classify --from clips/known --to clips/labelled
  murmillo motions label clips/mine --by random --groups 16 --to clips/labelled

  PATH         builtin, a folder of clips, a file of one, or ASE's .npy clips
  --by         from-name   the names, by --rule
               file        --file, JSON, YAML or CSV, with a label for each name
               cluster     similar motions into --groups
               classify    a network trained on the labelled clips of --from; its accuracy on held-out clips is printed
               random      --groups at random
  --rule       full        with from-name: full (walk_old of dataset-1_walk_old_001), content (walk), style (old), or a
                           regular expression whose groups are the label
  --seed       0           of cluster, classify and random
  --to         needed      folder for the labelled clips
  --replace    clips that are in this folder may go; so PATH itself can be named
  --character  whose clips: by default the folder's own
"""

NEEDS = {"from-name": None, "file": "file", "cluster": "groups", "classify": "labelled", "random": "groups"}
"""The option that each way of labelling cannot do without."""


def run(words: list[str]) -> int:
    """Write the clips with new labels, and print how many each has."""
    parser = Arguments("label")
    parser.add_argument("path")
    parser.add_argument("--by", choices=list(NEEDS), required=True)
    parser.add_argument("--rule", default="full")
    parser.add_argument("--file")
    parser.add_argument("--groups", type=int)
    parser.add_argument("--from", dest="labelled")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--to", required=True)
    parser.add_argument("--replace", action="store_true")
    parser.add_argument("--character")
    options = parser.parse(words)
    needed = NEEDS[options.by]
    if needed and getattr(options, needed) is None:
        name = "from" if needed == "labelled" else needed
        raise CommandError(f"--by {options.by}: needs --{name}; `murmillo motions label --help` shows an example")
    from murmillo.cli.motions import clips
    from murmillo.cli.seeds import check_seed

    check_seed("--seed", options.seed)
    clips.check_folder(options.to, options.replace)
    found, character = clips.load(options.path, options.character)
    labelled = _label(found, character, options)
    clips.save(options.to, labelled)
    counts = Counter(clip.label for clip in labelled)
    print(f"{len(counts)} labels: {', '.join(f'{label} ({count})' for label, count in counts.most_common())}")
    return 0


def _label(found: "Sequence[Clip]", character: "Character", options: argparse.Namespace) -> "list[Clip]":
    from murmillo.envs.motion import labels, load_clips

    if options.by == "from-name":
        return labels.from_names(found, options.rule)
    if options.by == "file":
        return labels.from_file(found, options.file)
    if options.by == "cluster":
        return labels.cluster(found, character, options.groups, options.seed)
    if options.by == "random":
        return labels.at_random(found, options.groups, options.seed)
    config = labels.ClassifierConfig(seed=options.seed)
    result, held = labels.classify(found, load_clips(options.labelled, character), character, config)
    print(
        f"held-out accuracy {100 * held.accuracy:.0f} %: {held.correct} of {held.clips} clips, {held.commonest} if all "
        f"got the commonest label; learned from {held.trained} clips"
    )
    return result
