"""Which runs are seeds of one another, what tells the groups apart, and which may be compared."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from murmillo.cli.comparison.record import Run

_IDLE = (
    "seed",
    "threads",
    "run.",
    "runner.checkpoint_minutes",
    "runner.watch.",
    "env.threads",
    "env.camera",
    "env.width",
    "env.height",
)
"""Settings that change nothing in what is learned from how much."""
_REPEATED = ("env.motions", "env.window")
"""Settings that follow from others."""
_FOREMOST = (
    "choices.task",
    "choices.agent",
    "choices.to",
    "choices.method",
    "choices.ablation",
    "motions",
    "choices.budget",
)
"""Settings that a label takes before all others."""
_SHARED_NETWORKS = ("agent.ppo.hidden", "agent.discriminator.hidden")
"""Networks that every method has; its further ones belong to the method."""
_ENDINGS = ("env.episode_steps", "env.fall.")
"""Settings that decide how long an episode can be."""
_TASK = ("choices.task", "task.")
"""Settings that decide what is rewarded."""
_SOURCES, _CLIPS = "sources", "clips"
"""What is not among the settings and yet decides: the commit of the code, and what the clips were."""
_ABSENT = "absent"
SAMPLES_TOLERANCE = 0.05
"""Runs that end by the clock differ by so much and may still be compared."""


@dataclass(frozen=True, eq=False)
class Group:
    """Runs that differ in nothing but their seed.

    Attributes:
        label: short, and of this group alone.
        runs: one a seed.
        settings: by dotted name, without those that change nothing.
        conditions: in what its training differs from that of the first group so that figures do not tell which is
            better.
        amount: how many samples more or less than the first group's it has, in words; empty where that is little.
    """

    label: str
    runs: tuple[Run, ...]
    settings: dict[str, Any]
    conditions: tuple[str, ...] = ()
    amount: str = ""

    @property
    def against(self) -> tuple[str, ...]:
        """Why the ends of its runs cannot be compared with those of the first group; empty where they can."""
        return (*self.conditions, *([self.amount] if self.amount else []))

    @property
    def samples(self) -> float:
        """Samples that all of its runs have reached."""
        return min(run.samples for run in self.runs)


def group(runs: Iterable[Run]) -> tuple[list[Group], list[tuple[Run, str]]]:
    """Groups in the order of their first runs, and the runs that are left out, each with the reason.

    Runs with the same settings and seed are told apart by the commit of their sources; what is equal in that too would
    count one seed twice and is left out.
    """
    alike: dict[str, list[Run]] = {}
    for run in runs:
        alike.setdefault(_key(_telling(run)), []).append(run)
    found: list[Group] = []
    repeated: list[tuple[Run, str]] = []
    for members in alike.values():
        for settings, kin in _by_sources(members):
            first = {run.seed: run for run in reversed(kin)}
            found.append(Group("", tuple(run for run in kin if first[run.seed] is run), settings))
            repeated += [
                (run, f"has the settings and the seed of {first[run.seed].folder}")
                for run in kin
                if first[run.seed] is not run
            ]
    labels = _labels(found)
    named = [replace(one, label=label) for one, label in zip(found, labels, strict=True)]
    compared = [
        replace(one, conditions=tuple(_conditions(one, named[0])), amount=_amount(one, named[0])) for one in named
    ]
    return compared, repeated


def _telling(run: Run) -> dict[str, Any]:
    telling = {name: value for name, value in run.settings.items() if not name.startswith((*_IDLE, *_REPEATED))}
    if run.clips:
        telling[_CLIPS] = hashlib.sha256(_key(run.clips).encode()).hexdigest()[:12]
    return telling


def _key(settings: dict[str, Any]) -> str:
    return json.dumps(settings, sort_keys=True, default=str)


def _by_sources(members: list[Run]) -> Iterator[tuple[dict[str, Any], list[Run]]]:
    """Runs of equal settings, by commit where a seed occurs more than once."""
    if len({run.seed for run in members}) == len(members):
        yield _telling(members[0]), members
        return
    commits: dict[str, list[Run]] = {}
    for run in members:
        commit = run.versions.get("git", {}).get("commit") or "unknown"
        commits.setdefault(commit[:12], []).append(run)
    for commit, kin in commits.items():
        yield {**_telling(kin[0]), **({_SOURCES: commit} if len(commits) > 1 else {})}, kin


def differing(groups: list[Group]) -> list[str]:
    """Names of the settings that are not the same in all groups, those that a reader knows best first."""
    names = set().union(*(one.settings for one in groups))
    telling = [name for name in names if len({shown(one, name) for one in groups}) > 1]
    return sorted(telling, key=lambda name: (_FOREMOST.index(name) if name in _FOREMOST else len(_FOREMOST), name))


def _labels(groups: list[Group]) -> list[str]:
    """The agent and its ablation, and of the settings that differ as few as tell the groups apart."""
    parts = []
    for one in groups:
        ablation = shown(one, "choices.ablation")
        parts.append([one.runs[0].agent, *([] if ablation in ("none", _ABSENT) else [ablation])])
    for name in differing(groups):
        for alike in {" ".join(part) for part in parts}:
            kin = [number for number, part in enumerate(parts) if " ".join(part) == alike]
            if len({shown(groups[number], name) for number in kin}) > 1:
                for number in kin:
                    parts[number].append(f"{name.removeprefix('choices.')}={shown(groups[number], name)}")
    return [" ".join(part) for part in parts]


def _conditions(one: Group, first: Group) -> Iterator[str]:
    (clips, digest), (known, its) = ((shown(some, "motions"), shown(some, _CLIPS)) for some in (one, first))
    if (digest != its) if _ABSENT not in (digest, its) else (clips != known):
        yield "other clips: " + (f"{clips} against {known}" if clips != known else f"{clips} were changed in between")
    for name in sorted({name for name in (*one.settings, *first.settings) if name.startswith(_TASK)}):
        if (value := shown(one, name)) != (known := shown(first, name)):
            yield f"another task: {name.removeprefix('choices.')} {value} against {known}"
    if (character := shown(one, "env.character")) != (known := shown(first, "env.character")):
        yield f"another character: {character} against {known}"
    for name in _networks(one, first):
        if (size := shown(one, name)) != (known := shown(first, name)):
            yield f"other networks: {name} {size} against {known}"
    endings = {name for name in (*one.settings, *first.settings) if name.startswith(_ENDINGS)}
    for name in sorted(endings):
        if (ending := shown(one, name)) != (known := shown(first, name)):
            yield f"other ends of an episode: {name} {ending} against {known}"


def _amount(one: Group, first: Group) -> str:
    mean, known = (sum(run.samples for run in some.runs) / len(some.runs) for some in (one, first))
    if abs(mean - known) <= SAMPLES_TOLERANCE * known:
        return ""
    return f"another number of samples: {mean:,.0f} against {known:,.0f}"


def _networks(one: Group, first: Group) -> list[str]:
    if one.runs[0].agent != first.runs[0].agent:
        return list(_SHARED_NETWORKS)
    return sorted(name for name in {**one.settings, **first.settings} if name.endswith("hidden"))


def shown(one: Group, name: str) -> str:
    """A setting of a group as text."""
    value = one.settings.get(name, _ABSENT)
    return value if isinstance(value, str) else json.dumps(value, default=str)
