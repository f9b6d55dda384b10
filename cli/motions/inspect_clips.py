"""`murmillo motions inspect`: measure clips and name what is suspicious."""

from murmillo.cli.motions.arguments import Arguments

HELP = """\
murmillo motions inspect: whether clips are sound

  murmillo motions inspect clips/mine                     a row for each clip
  murmillo motions inspect clips/mine --clip walk         one clip, and all that is suspicious about it

  PATH           builtin, a folder of clips, a file of one, or ASE's .npy clips
  --clip         name of one clip
  --tracking     simulate as well whether PD targets can follow the clips, a second or more each
  --character    whose clips: by default the folder's own

What the columns hold: the worst slide of a foot on the ground [cm in 1/30 s], the lowest point of the body [cm], the
fastest joint [rad/s], the largest change of a joint's speed within a frame [rad/s], with --tracking the share of frames
from which PD targets follow the clip for half a second, and each suspicion with its frame.
Exit status 0, whatever is found.
"""


def run(words: list[str]) -> int:
    """Print the measures of each clip and the suspicions; in full where one clip was asked for."""
    parser = Arguments("inspect")
    parser.add_argument("path")
    parser.add_argument("--clip")
    parser.add_argument("--tracking", action="store_true")
    parser.add_argument("--character")
    options = parser.parse(words)
    from murmillo.cli import tables
    from murmillo.cli.motions import clips
    from murmillo.envs.motion.inspection import TRACKING_EVERY, Suspicion, inspect
    from murmillo.envs.motion.measures import measure

    everything, character = clips.load(options.path, options.character)
    found = clips.select(everything, options.clip)
    suspicions: dict[str, list[Suspicion]] = {}
    rows = []
    for clip in found:
        suspicions[clip.name] = inspect(clip, character, options.tracking)
        m = measure(clip, character, TRACKING_EVERY if options.tracking else None)
        figures = (100 * m.slide, 100 * m.lowest, m.speed, m.jump)
        tracked = (f"{100 * m.tracked:.0f} %",) if options.tracking else ()
        words_found = ", ".join(f"{found.check} {found.frame}" for found in suspicions[clip.name])
        rows.append(
            (clip.name, f"{clip.duration:.2f}", *(f"{figure:.1f}" for figure in figures), *tracked, words_found)
        )
    followed = ("followed",) if options.tracking else ()
    columns = ("clip", "seconds", "slide", "lowest", "speed", "jump", *followed, "suspicious: check and frame")
    tables.show(columns, rows, left=(columns[0], columns[-1]))
    if options.clip is not None:
        for suspicion in suspicions[options.clip]:
            print(f"frame {suspicion.frame}, {suspicion.check}: {suspicion.what}")
    sound = sum(not found for found in suspicions.values())
    print(f"{sound} of {len(found)} clips show nothing suspicious")
    return 0
