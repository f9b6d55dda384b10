"""`murmillo merge`: the policy of an adaptation and its adapters as one network, in a run of its own."""

from dataclasses import dataclass

HELP = """\
murmillo merge: make one network of an adapted policy

  murmillo merge run=runs/<adaptation> into=runs/<name>                     a run like any other, without adapters
  murmillo merge run=runs/<adaptation> into=runs/<name> alpha=0.5           half way between the base and the adaptation
  murmillo merge run=runs/<one> with=runs/<other> alpha=0.3 into=runs/<name>    0.3 of the one and 0.7 of the other

  run       needed           folder of a run that adapts another: of ase, calm, case or adaptnet
  into      needed           folder of the new run
  alpha     all of it        how much of the adaptation acts, 0 to 1; of two 0.5
  with      none             folder of another adaptation of the same base
  worlds    64               episodes that it is measured in, for its report and `murmillo compare`; 0 for none
  base      the run's own    AdaptNet: folder of the run that it adapts, where it has moved
  motions   the run's own    a folder or file, where the clips have moved

It acts as the adaptation does, to 1e-5, under the same latents, labels and encodings, and needs no base. It is
measured, filmed, played, compared and put beneath a task like any other run, and learns no more (docs/adaptnet.md).
"""


@dataclass
class MergeConfig:
    """What `murmillo merge` takes; see `HELP`."""

    run: str
    into: str
    alpha: float | None = None
    other: str | None = None
    worlds: int = 64
    base: str | None = None
    motions: str | None = None


def run(words: list[str]) -> int:
    """Merge, look whether the new run acts as the adaptation does, and keep it."""
    from murmillo.cli import config as configuration
    from murmillo.cli import runs
    from murmillo.cli.blending import Blend, renamed
    from murmillo.cli.errors import CommandError
    from murmillo.cli.merging import open_adaptation, save

    settings = configuration.parse(MergeConfig, renamed(words))
    blend = Blend(settings.alpha, settings.other)
    if settings.worlds < 0:
        raise CommandError(f"worlds={settings.worlds}: needs a number of episodes, or 0 for none")
    into = runs.vacant_at(settings.into, "into")
    adaptation = open_adaptation(settings.run, settings.base, settings.motions)
    merged, difference = save(adaptation, blend, into)
    how = f"{settings.run} with {blend}" if blend else settings.run
    print(f"{into}: {how} as one network; its actions differ by {difference:.1e} at most", flush=True)
    if settings.worlds:
        print("measuring it, and a policy that has learned nothing", flush=True)
    print(f"the report: {merged.report(settings.worlds)}")
    return 0
