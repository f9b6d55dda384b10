"""`murmillo motions mirror`: clips with left and right exchanged."""

from murmillo.cli.motions.arguments import Arguments

HELP = """\
murmillo motions mirror: add clips with left and right exchanged

  murmillo motions mirror clips/mine --to clips/both           the clips and their mirror images
  murmillo motions mirror clips/mine --clip kick --to clips/both

  PATH         builtin, a folder of clips, a file of one, or ASE's .npy clips
  --clip       name of the only clip to be mirrored
  --only       leave out the clips as they are
  --to         needed          folder for the clips
  --replace    clips that are in this folder may go; so PATH itself can be named
  --character  whose clips: by default the folder's own

"left" and "right" change places in names and labels too; another name gets _mirrored behind it. The sword stays in the
right hand and the shield on the left arm, whose motion is then the other arm's: these two are masked, and what the clip
shows of them is not learned from.
"""


def run(words: list[str]) -> int:
    """Write the clips and their mirror images."""
    parser = Arguments("mirror")
    parser.add_argument("path")
    parser.add_argument("--clip")
    parser.add_argument("--only", action="store_true")
    parser.add_argument("--to", required=True)
    parser.add_argument("--replace", action="store_true")
    parser.add_argument("--character")
    options = parser.parse(words)
    import dataclasses

    from murmillo.cli.motions import clips
    from murmillo.envs.motion.editing import mirror

    clips.check_folder(options.to, options.replace)
    found, character = clips.load(options.path, options.character)
    mirrored = [mirror(clip, character) for clip in clips.select(found, options.clip)]
    if options.only:
        clips.save(options.to, mirrored)
        return 0
    taken = {clip.name for clip in found}
    # where a turn to the left and one to the right are both there, their images need names of their own
    named = [
        dataclasses.replace(clip, name=f"{clip.name}_mirrored") if clip.name in taken else clip for clip in mirrored
    ]
    clips.save(options.to, [*found, *clips.told_apart(named, taken)])
    return 0
