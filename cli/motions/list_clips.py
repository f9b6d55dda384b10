"""`murmillo motions list`: what is in a folder of clips."""

from murmillo.cli.motions.arguments import Arguments

HELP = """\
murmillo motions list: what is in a folder of clips

  murmillo motions list builtin
  murmillo motions list clips/mine

  PATH           builtin, a folder of clips, a file of one, or ASE's .npy clips
  --character    whose clips: by default the folder's own, of the built-in pack sword_shield
"""


def run(words: list[str]) -> int:
    """Print a row for each clip."""
    parser = Arguments("list")
    parser.add_argument("path")
    parser.add_argument("--character")
    options = parser.parse(words)
    from murmillo.cli import tables
    from murmillo.cli.motions import clips
    from murmillo.envs.motion.licences import terms_of

    found, character = clips.load(options.path, options.character)
    rows = [
        (
            clip.name,
            clip.label,
            f"{clip.duration:.2f}",
            f"{clip.frames}",
            f"{clip.fps:g}",
            "loop" if clip.loop else "",
            ", ".join(clip.masked),
            clip.licence,
            "yes" if clip.redistributable else "no",
            clip.source,
        )
        for clip in found
    ]
    columns = ("clip", "label", "seconds", "frames", "fps", "loop", "masked", "licence", "redistributable", "source")
    tables.show(columns, rows, left=("clip", "label", "loop", "masked", "licence", "redistributable", "source"))
    labels = len({clip.label for clip in found})
    print(f"{len(found)} clips of {labels} labels for {character.name}, {sum(clip.duration for clip in found):.1f} s")
    print(terms_of(found))
    return 0
