"""`murmillo motions preview`: draw clips without a screen."""

from murmillo.cli import gl
from murmillo.cli.errors import CommandError
from murmillo.cli.motions.arguments import Arguments

HELP = """\
murmillo motions preview: draw clips

  murmillo motions preview builtin --to pictures                 a contact sheet of each clip
  murmillo motions preview clips/mine --clip walk --to pictures --film

  PATH         builtin, a folder of clips, a file of one, or ASE's .npy clips
  --clip       name of the only clip to be drawn
  --to         needed          folder for the pictures, one a clip
  --sheet      contact sheets, PNG: moments from left to right, seen aslant, from the right and from ahead (the default)
  --film       films, mp4, at the clip's own speed
  --camera     track           of the film: track, side or front
  --character  whose clips: by default the folder's own

Works without a screen, through EGL or OSMesa; `murmillo doctor` says whether this machine has one of them.
"""


def run(words: list[str]) -> int:
    """Write the pictures."""
    parser = Arguments("preview")
    parser.add_argument("path")
    parser.add_argument("--clip")
    parser.add_argument("--to", required=True)
    parser.add_argument("--sheet", action="store_true")
    parser.add_argument("--film", action="store_true")
    parser.add_argument("--camera", choices=("track", "side", "front"), default="track")
    parser.add_argument("--character")
    options = parser.parse(words)
    # MuJoCo reads its choice when it is imported, so nothing that imports it may come before this line
    tried = gl.candidates()
    if gl.choose() is None:
        raise CommandError(gl.no_gl_message(tried))
    from pathlib import Path

    from murmillo.cli.motions import clips
    from murmillo.envs.motion.preview import contact_sheet, film

    everything, character = clips.load(options.path, options.character)
    folder = Path(options.to)
    for clip in clips.select(everything, options.clip):
        stem = clip.name.replace("/", "_")
        if options.sheet or not options.film:
            print(contact_sheet(clip, character, folder / f"{stem}.png"), flush=True)
        if options.film:
            print(film(clip, character, folder / f"{stem}.mp4", options.camera), flush=True)
    return 0
