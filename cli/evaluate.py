"""`murmillo evaluate`: what the papers measure, of a run, beside the clips, the untrained policy and the papers."""

from dataclasses import dataclass
from typing import Any, Literal

from murmillo.cli.errors import CommandError

HELP = """\
murmillo evaluate: measure a trained agent as the papers do

  murmillo evaluate run=runs/<name>                  the quick metrics, in a minute or two
  murmillo evaluate run=runs/<name> metrics=all trajectories=10000

  run            needed           folder of the run
  metrics        quick            quick, all, or some of: coverage, transitions, frechet, diversity, concentration,
                                  inception, controllability, residual, quality, recovery; metrics=[coverage,frechet]
  trajectories   256, or 1000     for each source and protocol; the papers have 1,000 (ASE) and 10,000 (C·ASE)
  checkpoint     last             last, or all: those too that the run kept on its way (train … run.keep_every=SAMPLES),
                                  for the curve of coverage against samples
  seed           12345            of all that is random
  start          default          default or reference: a standing pose, or random moments of the clips
  worlds         64               episodes that the policy is measured in before and after training, 0 for none
  motions        the run's own    a folder or file, where the clips have moved; other clips are not comparable

Writes evaluation.md, evaluation.html and evaluation/ into the run's folder. What is recorded stays there: the same
command goes on where it was stopped. docs/metrics.md says how each metric is measured.

Of a run of any method that adapts another (murmillo train base=… to=…), also a part of its adaptation, or two at once:

  alpha          all of it        how much of the adaptation acts, 0 to 1; of two 0.5
  with           none             folder of another adaptation of the same base, of which 1 - alpha acts

What is found lies in blends/alpha=0.5/ and the like in the run's folder.

Of a run that learned a task (murmillo train task=…): its normalised return beside that of the untrained policy and of
random latents, in worlds=256 episodes, as a table and in report.md; it takes seed, motions and

  low            the run's own    folder of the low-level run, where it has moved

Of a run of agent=adaptnet: goal reward, episode length and imitation error of the policy before and after training, in
worlds=256 episodes; it takes seed, motions and

  base           the run's own    of an adaptation: folder of the run that it adapts, where it has moved

  murmillo evaluate machine=strike run=runs/<calm> heading=runs/<precision>     a state machine does a task, untrained

Its success rate beside CALM's, time to success and time in each state, and every transition in machines/ of the run's
folder; it takes seed, motions, worlds=64, seconds (an attempt's), parameters of the machine (style=walk_forward) and

  machine        needed           location, strike or a YAML file (docs/machines.md)
  run            needed           folder of a run of agent=calm
  heading        where needed     folder of a run of task=direction over it, by which states go somewhere
"""

_QUICK_TRAJECTORIES = 256
_TRAJECTORIES = 1000


@dataclass
class EvaluateConfig:
    """What `murmillo evaluate` takes; see `HELP`."""

    run: str
    metrics: tuple[str, ...] = ("quick",)
    trajectories: int | None = None
    seed: int = 12345
    start: Literal["default", "reference"] = "default"
    worlds: int = 64
    motions: str | None = None
    checkpoint: Literal["last", "all"] = "last"
    alpha: float | None = None
    other: str | None = None


def run(words: list[str]) -> int:
    """Measure, print the figures and write the reports."""
    from murmillo.cli import config as configuration
    from murmillo.cli import runs
    from murmillo.cli.adaptation.words import is_adaptnet_run
    from murmillo.cli.blending import Blend, renamed
    from murmillo.cli.evaluation.bench import Request
    from murmillo.cli.evaluation.evaluating import evaluate
    from murmillo.cli.seeds import check_seed
    from murmillo.cli.tasks.words import is_task_run, value_of

    if value_of(words, "machine") is not None:
        from murmillo.cli.machines.evaluate import run as evaluate_machine

        return evaluate_machine(words)
    if is_adaptnet_run(value_of(words, "run")):
        from murmillo.cli.adaptation.evaluate import run as evaluate_adaptnet

        return evaluate_adaptnet(words)
    if is_task_run(value_of(words, "run")):
        from murmillo.cli.tasks.evaluate import run as evaluate_task

        return evaluate_task(words)
    settings = configuration.parse(EvaluateConfig, [_listed(word) for word in renamed(words)])
    blend = Blend(settings.alpha, settings.other)
    trajectories = settings.trajectories
    if trajectories is None:
        trajectories = _QUICK_TRAJECTORIES if settings.metrics == ("quick",) else _TRAJECTORIES
    if trajectories < 1:
        raise CommandError(f"trajectories={trajectories}: needs at least 1")
    if settings.worlds < 0:
        raise CommandError(f"worlds={settings.worlds}: needs a number of episodes, or 0 for none")
    check_seed("seed", settings.seed)
    if not settings.metrics:
        raise CommandError("metrics=[]: name some, or quick or all")
    folder = runs.existing(settings.run, "run")
    config = configuration.load(folder)
    request = Request(
        settings.metrics,
        trajectories,
        settings.seed,
        settings.start,
        settings.worlds,
        settings.motions,
        along=settings.checkpoint == "all",
        blend=blend,
    )
    try:
        results = evaluate(config, folder, request)
    except KeyboardInterrupt:
        print(f"stopped; what is recorded stays, go on with: murmillo evaluate {' '.join(words)}")
        return 130
    _print(results)
    print(f"the report: {blend.place(folder) / runs.EVALUATED} (and {runs.EVALUATED_HTML}, {runs.METRICS})")
    return 0


def _listed(word: str) -> str:
    """One metric needs no brackets."""
    name, _, value = word.partition("=")
    return f"metrics=[{value}]" if name == "metrics" and value and not value.startswith("[") else word


def _print(results: dict[str, Any]) -> None:
    from murmillo.cli import tables
    from murmillo.cli.ages import show_ages
    from murmillo.cli.evaluation.report import figure_rows

    if "ages" in results:
        show_ages(results["ages"])
        print()
    tables.show(
        ("", "this run", "untrained", "clips replayed", "published"), figure_rows(results, spread=False), left=("",)
    )
    for name, reason in results["left_out"].items():
        print(f"left out: {name}, {reason}")
    if results["not_comparable"]:
        print(f"not comparable: {results['not_comparable']}")
