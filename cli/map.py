"""`murmillo map`: the latent spaces of AdaptNet's policies, side by side in the plane."""

import os
from dataclasses import dataclass
from pathlib import Path

from murmillo.cli.errors import CommandError

HELP = """\
murmillo map: draw the latents of a base and of what was made of it

  murmillo map runs/<base> runs/<style> runs/<style>      as latents.png in the working folder

  RUN …     needed           runs of agent=adaptnet: a base and adaptations of it
  points    300              of each run, moments of its own walks
  out       latents.png      file
  seed      1                of the walks

Each point is the latent Z^0 in which the encoder puts a moment (AdaptNet, Figure 17); near points are near in the plane
as far as a plane can show it (classical multidimensional scaling).
"""


@dataclass
class MapConfig:
    """The settings of `murmillo map`; see `HELP`."""

    points: int = 300
    out: str = "latents.png"
    seed: int = 1


def run(words: list[str]) -> int:
    """Let each policy walk, and draw where its latents lie."""
    from murmillo.cli import config as configuration
    from murmillo.cli.adaptation.latents import check_one_base, draw, walk
    from murmillo.cli.adaptation.words import AGENT, is_adaptnet_run
    from murmillo.cli.adaptation.world import open_run
    from murmillo.cli.compare import folders, is_setting
    from murmillo.cli.evaluation.identity import checkpoint_digest
    from murmillo.cli.runs import LAST, MERGED
    from murmillo.cli.seeds import check_seed
    from murmillo.cli.tasks.words import choices_of

    settings = configuration.parse(MapConfig, [word for word in words if is_setting(word)])
    if settings.points < 2:
        raise CommandError(f"points={settings.points}: needs at least 2 of each run")
    check_seed("seed", settings.seed)
    out = Path(settings.out)
    if out.suffix != ".png" or out.is_dir() or not os.path.isdir(out.parent):
        raise CommandError(f"out={settings.out}: needs a file name that ends in .png, in a folder that exists")
    found = folders([word for word in words if not is_setting(word)], "map")
    for folder in found:
        if not is_adaptnet_run(str(folder)):
            raise CommandError(f"{folder}: this is no run of agent={AGENT}, which alone have such latents")
        if (made := choices_of(str(folder)).get(MERGED)) is not None:
            raise CommandError(f"{folder}: this run was merged of {made} and has its latents no more; name that one")
        if (method := choices_of(str(folder)).get("method")) in ("scratch", "progressive"):
            raise CommandError(f"{folder}: a run of method={method} has latents of its own; name others of its base")
    opened = [open_run(folder) for folder in found]
    bases = [
        checkpoint_digest((folder if base is None else base.folder) / LAST)
        for folder, (_, base) in zip(found, opened, strict=True)
    ]
    check_one_base(found, bases)
    latents = {
        folder.name: walk(config, base, folder, settings.points, settings.seed)
        for folder, (config, base) in zip(found, opened, strict=True)
    }
    draw(latents, out)
    print(f"drawn {settings.points} latents of {len(found)} runs: {out}")
    return 0
