"""`murmillo bench`: how fast this machine trains, and with how many worlds and threads it is fastest."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from murmillo.cli.errors import CommandError

if TYPE_CHECKING:
    from murmillo.cli.benching.measuring import Findings

HELP = """\
murmillo bench: measure how fast this machine trains, in about a minute

  murmillo bench                                     ASE at budget=smoke, as `murmillo train` does it
  murmillo bench agent=calm budget=laptop            another agent and budget: any settings of `murmillo train`
  murmillo bench num_envs=2048 threads=8 out=bench.json

  seconds        45               to measure for; setting up comes on top
  out            none             a JSON file for what was found

Prints what physics, environment, rollout, learner and a whole iteration do a second, the environment with other
numbers of worlds and threads, and the hours that the budget's samples take. Runs on a machine that does other work
mean little. docs/benchmarks.md says how it is measured.
"""

OWN = ("seconds", "out")


@dataclass
class BenchConfig:
    """The settings of `murmillo bench` beside those of a training; see `HELP`."""

    seconds: float = 45.0
    out: str | None = None


def run(words: list[str]) -> int:
    """Measure, print the tables and write the file."""
    from murmillo.cli import config as configuration
    from murmillo.cli import runs
    from murmillo.cli.benching.measuring import measure

    settings = configuration.parse(BenchConfig, [word for word in words if _is_own(word)])
    if not 0 < settings.seconds <= 3600:
        raise CommandError(f"seconds={settings.seconds:g}: needs a number above 0, up to 3600")
    out = None if settings.out is None else Path(settings.out)
    if out is not None and (out.suffix != ".json" or out.is_dir() or not os.path.isdir(out.parent)):
        raise CommandError(f"out={settings.out}: needs a file name that ends in .json, in a folder that exists")
    training = [word for word in words if not _is_own(word)]
    _check(training)
    findings = measure(training, settings.seconds, lambda text: print(f"measuring {text}", flush=True))
    print()
    _show(findings)
    if out is not None:
        runs.write_json(out, findings.as_json())
        print(f"kept in {out}")
    return 0


def _is_own(word: str) -> bool:
    return word.partition("=")[0] in OWN


def _check(words: Sequence[str]) -> None:
    """Refuse trainings that go on from another run, and sweeps."""
    for word in words:
        if word.startswith("-"):
            raise CommandError(f"{word}: there is no such option; bench takes the settings of one training and --help")
        name, _, value = word.lstrip("+").partition("=")
        if name in ("low", "base", "run.resume") or (name, value) == ("stage", "adapt") or name == "task":
            raise CommandError(f"{word}: bench measures trainings from nothing on clips; drop {name}=…")


def _show(found: "Findings") -> None:
    from murmillo.cli import tables, versions
    from murmillo.cli.benching.learning import ITERATION, ROLLOUT, UPDATE
    from murmillo.cli.benching.measuring import fastest

    asked = found.training
    packages = versions.package_versions()
    known = ", ".join(f"{name} {packages[name]}" for name in ("murmillo", "mujoco", "torch"))
    print(f"{versions.processor()}, {versions.usable_cores()} cores, GPU {versions.gpu() or 'none'}; {known}")
    sizes = f"{asked['num_envs']} worlds, {asked['threads']} threads"
    print(f"{asked['agent']}, {asked['budget']}: {sizes}; {found.physics}")
    print()
    of = f"at 1/{found.fraction} of its worlds and minibatches" if found.fraction > 1 else ""
    notes = {ROLLOUT: of, UPDATE: of, ITERATION: of}
    rows = [(name, f"{rate:,.0f}", notes.get(name, "")) for name, rate in found.rates.items()]
    tables.show(("", "samples/s", " "), rows, left=("", " "))
    print()
    for name, own, rates in (
        ("worlds", asked["num_envs"], found.worlds),
        ("threads", asked["threads"], found.threads),
    ):
        if rates:
            best = fastest(rates, own)
            marks = {own: "yours", best: "the fastest"} if best != own else {own: "yours, and none is faster"}
            rows = [(str(number), f"{rate:,.0f}", marks.get(number, "")) for number, rate in rates.items()]
            tables.show((name, "environment steps/s", " "), rows, left=(" ",))
            print()
    speed = f"{found.rates[ITERATION]:,.0f} a second"
    print(f"{asked['samples']:,} samples take {_hours(found.hours)} at {speed}{_cut(found)}")
    print(f"memory: {found.peak_bytes / 1e9:.1f} GB at its peak")


def _hours(hours: float) -> str:
    return f"{60 * hours:.0f} minutes" if hours < 1 else f"{hours:,.1f} hours"


def _cut(found: "Findings") -> str:
    """Whether the training ends before."""
    limit = found.training["max_minutes"]
    if limit is None or 60 * found.hours <= limit:
        return ""
    return f"; runner.max_minutes={limit:g} ends it after {limit / 60 / found.hours:.0%} of them"
