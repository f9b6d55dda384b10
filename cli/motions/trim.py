"""`murmillo motions trim`: cut a clip."""

from murmillo.cli.motions.arguments import Arguments

HELP = """\
murmillo motions trim: cut a clip, such as a rest pose at its start

  murmillo motions trim clips/mine --clip walk --start 0.5 --end 3.2 --to clips/cut

  PATH         builtin, a folder of clips or a file of one
  --clip       needed          name of the clip
  --start      0               first second that stays
  --end        the clip's end  last second that stays
  --to         needed          folder for the clips of PATH with this one cut
  --replace    clips that are in this folder may go; so PATH itself can be named
  --character  whose clips: by default the folder's own
"""


def run(words: list[str]) -> int:
    """Write the clips with one of them cut."""
    parser = Arguments("trim")
    parser.add_argument("path")
    parser.add_argument("--clip", required=True)
    parser.add_argument("--start", type=float, default=0.0)
    parser.add_argument("--end", type=float)
    parser.add_argument("--to", required=True)
    parser.add_argument("--replace", action="store_true")
    parser.add_argument("--character")
    options = parser.parse(words)
    from murmillo.cli.motions import clips
    from murmillo.envs.motion.editing import trim

    clips.check_folder(options.to, options.replace)
    found, _ = clips.load(options.path, options.character)
    (chosen,) = clips.select(found, options.clip)
    cut = trim(chosen, options.start, options.end)
    clips.save(options.to, [cut if clip is chosen else clip for clip in found])
    print(f"{chosen.name}: {chosen.duration:.2f} s cut to {cut.duration:.2f} s")
    return 0
