"""`comparison.md`: the groups side by side, what cannot be compared, the curves and every figure."""

from collections.abc import Iterable
from pathlib import Path

from murmillo.cli.comparison.grouping import SAMPLES_TOLERANCE, Group, differing, shown
from murmillo.cli.comparison.record import LAST_PART, Quantity
from murmillo.cli.comparison.statistics import RESAMPLES, Summary
from murmillo.cli.comparison.table import Table, cell, heading, headlines, interval, number

_FEW = 5
"""Seeds below which the page warns of the interval."""


def page(groups: list[Group], left_out: list[tuple[Path, str]], table: Table, pictures: list[Path]) -> str:
    """The whole page, Markdown. Pictures lie beside it."""
    seeds = sum(len(one.runs) for one in groups)
    sections = [
        f"# {_count(seeds, 'run')} in {_count(len(groups), 'group')}",
        _markdown(*summary_table(groups, table), left=("group", "comparable")),
        _seeds(groups),
        _machines(groups),
        _left_out(left_out),
        "## Learning curves\n\nMeans over the seeds of a group (their number in brackets), smoothed over a twentieth "
        "of the training, with the 95 % bootstrap interval of the mean; dashed what learned under other conditions. "
        "A line ends where the shortest of its runs ends.",
        *(f"![{picture.stem.replace('_', ' ')}]({picture.name})" for picture in pictures),
        _every(table),
        _protocols(table),
        _meaning(),
        _runs(groups),
        _settings(groups),
    ]
    return "\n\n".join(section for section in sections if section) + "\n"


def summary_table(groups: list[Group], table: Table) -> tuple[list[str], list[list[str]]]:
    """Columns and a row for each group: the figures that a reader looks for first."""
    shown = headlines(table)
    columns = ["group", "seeds", *(heading(quantity) for quantity in shown), "comparable"]
    rows = [
        [
            one.label,
            str(len(one.runs)),
            *(cell(quantity, table[quantity].get(one.label)) for quantity in shown),
            f"no: {'; '.join(one.against)}" if one.against else "yes",
        ]
        for one in groups
    ]
    return columns, rows


def _seeds(groups: list[Group]) -> str:
    lines = [
        "Figures are interquartile means over the seeds of a group, with the 95 % bootstrap interval in brackets. "
        f"Comparable means: with the first group, `{groups[0].label}`."
    ]
    if single := [f"`{one.label}`" for one in groups if len(one.runs) == 1]:
        lines.append(
            f"A single seed, so no interval: {', '.join(single)}. How far another seed would be from it is not known."
        )
    if few := [f"`{one.label}`" for one in groups if 1 < len(one.runs) < _FEW]:
        lines.append(
            f"Fewer than {_FEW} seeds: {', '.join(few)}. So few scores give intervals that are too narrow: do not "
            "conclude from two that just miss each other."
        )
    return "\n\n".join(lines)


def _machines(groups: list[Group]) -> str:
    machines: dict[str, list[str]] = {}
    for one in groups:
        for run in one.runs:
            machine = run.versions.get("machine", {})
            words = [machine.get("processor") or "unknown processor", f"{run.versions.get('threads', '?')} threads"]
            machines.setdefault(", ".join([*words, *([machine["gpu"]] if machine.get("gpu") else [])]), []).append(
                f"`{run.folder.name}`"
            )
    if len(machines) < 2:
        return ""
    lines = (f"- {machine}: {', '.join(names)}" for machine, names in machines.items())
    return "\n".join(["Hours and throughput are not comparable between machines:", "", *lines])


def _left_out(left_out: list[tuple[Path, str]]) -> str:
    if not left_out:
        return ""
    return "\n".join(["## Left out", "", *(f"- `{folder}` {reason}" for folder, reason in left_out)])


def _every(table: Table) -> str:
    sections = ["## Every figure"]
    for source in dict.fromkeys(quantity.source for quantity in table):
        rows = []
        for quantity in table:
            if quantity.source == source:
                title = heading(quantity)
                for label, summary in table[quantity].items():
                    rows.append([title, label, str(len(summary.scores)), *_spelt_out(summary)])
                    title = ""  # said once for all groups
        columns = ("figure", "group", "seeds", "mean", "interquartile mean", "95 % interval", "least to most")
        sections += [f"### {source.capitalize()}", _markdown(columns, rows, left=("figure", "group"))]
    return "\n\n".join(sections)


def _spelt_out(summary: Summary) -> list[str]:
    if summary.interval is None:
        return [number(summary.mean), number(summary.iqm), "single seed", "-"]
    ends = f"{number(min(summary.scores))} to {number(max(summary.scores))}"
    return [number(summary.mean), number(summary.iqm), interval(summary.interval), ends]


def _protocols(table: Iterable[Quantity]) -> str:
    lines = [f"- {heading(quantity)}: {quantity.protocol}" for quantity in table if quantity.protocol]
    return "\n".join(["## How the evaluation measured", "", *lines]) if lines else ""


def _meaning() -> str:
    return (
        "## How to read this\n\n"
        "- A group is the runs whose settings differ in the seed alone (and in what cannot matter: folder, threads, "
        "camera, checkpoints).\n"
        "- Interquartile mean: of the middle half of the scores, so that one seed out of the way does not decide. Of "
        "fewer than four seeds nothing is cut off, and it is the mean.\n"
        f"- Interval: percentiles of {RESAMPLES:,} bootstrap draws of the seeds; with one set of clips there is one "
        "stratum (Agarwal et al. 2021, Deep reinforcement learning at the edge of the statistical precipice).\n"
        "- Style score and style reward come from the discriminator of each run itself. A stronger judge gives less to "
        "the same motion: read them beside the episode length and the coverage.\n"
        f"- Figures while training are means over the last {100 * LAST_PART:.0f} % of the samples: at the end, and "
        "where the shortest run under equal conditions ends. All others are of the policy at its end, and groups whose "
        f"samples are more than {100 * SAMPLES_TOLERANCE:.0f} % apart are not comparable in them.\n"
        "- ↑ more is better, ↓ less is better."
    )


def _runs(groups: list[Group]) -> str:
    rows = [[one.label, str(run.seed), number(run.samples), f"`{run.folder}`"] for one in groups for run in one.runs]
    return "## The runs\n\n" + _markdown(("group", "seed", "samples", "folder"), rows, left=("group", "folder"))


def _settings(groups: list[Group]) -> str:
    """The settings that differ, group by group; a setting that an agent does not have is absent."""
    names = differing(groups)
    if not names:
        return ""
    rows = [[f"`{name}`", *(shown(one, name) for one in groups)] for name in names]
    columns = ["setting", *(one.label for one in groups)]
    return "## Settings that differ\n\n" + _markdown(columns, rows, left=tuple(columns))


def _markdown(columns: Iterable[str], rows: Iterable[Iterable[str]], left: tuple[str, ...]) -> str:
    columns = list(columns)
    rule = ["---" if column in left else "---:" for column in columns]
    lines = (" | ".join(text.replace("|", "\\|") for text in row) for row in (columns, rule, *rows))
    return "\n".join(f"| {line} |" for line in lines)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
