"""`evaluation.md` and `evaluation.html` of a run: each figure beside its scale and beside the paper's."""

from pathlib import Path
from typing import Any

from murmillo.cli import runs
from murmillo.cli.evaluation.page import page_of
from murmillo.cli.evaluation.published import CONDITIONS, METHODS, Published, published
from murmillo.cli.evaluation.sources import REPLAYED, SOURCES, TRAINED, UNTRAINED
from murmillo.cli.evaluation.table import METRICS, FigureKind, Metric
from murmillo.cli.rollouts import AGES

_GOOD = {"up": " ↑", "down": " ↓", "": ""}
_COLUMNS = (TRAINED, UNTRAINED, REPLAYED)


def write(folder: Path, results: dict[str, Any], pictures: list[tuple[str, Path]]) -> Path:
    """Write both forms of the report; the path of the Markdown."""
    sections = [
        f"# Evaluation of {results['run']}",
        _what(results),
        _figures(results),
        _published(results),
        _ages(results.get("ages", {})),
        _pictures(folder, pictures),
        _meanings(results),
        _left_out(results["left_out"]),
        _going_on(folder),
    ]
    text = "\n\n".join(section for section in sections if section) + "\n"
    runs.write_text(folder / runs.EVALUATED, text)
    runs.write_text(folder / runs.EVALUATED_HTML, page_of(text, folder))
    return folder / runs.EVALUATED


def section(results: dict[str, Any] | None) -> str:
    """The figures for the report of the run itself, Markdown; empty where nothing was evaluated."""
    if results is None:
        return ""
    return "\n".join(
        [
            "## Beside the clips and the papers",
            "",
            f"{results['trajectories']:,} trajectories of the policy at {results['samples']:,} samples. What the "
            f"figures mean, pictures and conditions: [`{runs.EVALUATED}`]({runs.EVALUATED}), "
            f"[`{runs.EVALUATED_HTML}`]({runs.EVALUATED_HTML}).",
            "",
            *_table(results),
        ]
    )


def figure_rows(results: dict[str, Any], spread: bool = True) -> list[tuple[str, ...]]:
    """Title, this run, untrained, clips replayed, and the paper's figure of the same method; a row a figure."""
    rows = []
    for metric in _shown(results):
        for kind in metric.figures:
            values = results["metrics"][metric.name]["figures"][kind.name]["values"]
            cells = [_cell(kind, values.get(source), spread) for source in _COLUMNS]
            own = published(kind.name, results["agent"])
            paper = kind.show(own[0].value, own[0].spread if spread else None) if own else "-"
            rows.append((kind.title + _GOOD[kind.better], *cells, paper))
    return rows


def _table(results: dict[str, Any]) -> list[str]:
    titles = [SOURCES[source] for source in _COLUMNS]
    return [
        f"| | {' | '.join(titles)} | {METHODS.get(results['agent'], results['agent'])} as published |",
        "|---|---:|---:|---:|---:|",
        *(f"| {' | '.join(row)} |" for row in figure_rows(results)),
    ]


def _shown(results: dict[str, Any]) -> list[Metric]:
    return [METRICS[name] for name in results["metrics"]]


def _cell(kind: FigureKind, value: dict[str, Any] | None, spread: bool) -> str:
    return "-" if value is None else kind.show(value["value"], value["spread"] if spread else None)


def _what(results: dict[str, Any]) -> str:
    clips, duplicates = results["clips"], results["clips"]["duplicates"]
    same = "; ".join(" = ".join(group) for group in duplicates)
    lines = [
        f"`{results['agent']}` after {results['samples']:,} samples (checkpoint {results['checkpoint'][:12]}): "
        f"{results['trajectories']:,} trajectories, each in a world of its own, from the {results['start']} "
        f"{'pose' if results['start'] == 'default' else 'clips'}, with the policy's mean action, seed "
        f"{results['seed']}. The clips `{clips['motions']}` are {clips['count']}, {clips['distinct']} of them distinct"
        f"{f' ({same}: bit for bit the same, they count once)' if same else ''}, {clips['seconds']:.0f} s together.",
    ]
    if "base" in results:
        lines.append(
            f"It adapts `{results['base']}`: the *{SOURCES[UNTRAINED]}* policy is that one, put into this world."
        )
    if "blend" in results:
        lines.append(_blend(**results["blend"]))
    if results["not_comparable"]:
        lines.append(f"**Not comparable**: {results['not_comparable']}.")
    return "\n\n".join(lines)


def _blend(alpha: float | None, **other: Any) -> str:
    """How much of which adapters acted."""
    if other["with"] is None:
        return f"Of its adapter {alpha:g} acts: 0 would be the base, 1 the adaptation."
    alpha = 0.5 if alpha is None else alpha
    return f"Of its adapter {alpha:g} acts, and {1 - alpha:g} of that of `{other['with']}`."


def _figures(results: dict[str, Any]) -> str:
    diverged = sum(sum(metric["diverged"].values()) for metric in results["metrics"].values())
    return "\n".join(
        [
            "## Figures",
            "",
            f"The scale is in the table: the *{SOURCES[UNTRAINED]}* policy of the same seed below, the "
            f"*{SOURCES[REPLAYED]}* through the same protocol above. An arrow says which way is good; ± is a standard "
            "deviation.",
            "",
            *_table(results),
            *(["", f"{diverged} trajectories diverged in the simulation and were left out."] if diverged else []),
        ]
    )


def _published(results: dict[str, Any]) -> str:
    kinds = [kind for metric in _shown(results) for kind in metric.figures]
    entries = [(kind, entry) for kind in kinds for entry in published(kind.name)]
    if not entries:
        return ""
    rows = [
        f"| {kind.title} | {METHODS[e.method]} | {kind.show(e.value, e.spread)} | {e.source} | {e.note or ''} |"
        for kind, e in entries
    ]
    return "\n".join(
        [
            "## What the papers report",
            "",
            "| | method | figure | source | note |",
            "|---|---|---:|---|---|",
            *rows,
            "",
            "They were measured under other conditions, so that they say where one is, not which is better:",
            "",
            *_conditions(results, [entry for _, entry in entries]),
        ]
    )


def _conditions(results: dict[str, Any], entries: list[Published]) -> list[str]:
    hidden = "-".join(map(str, results["hidden"]))
    rows = [f"| this run | {results['samples']:,} | MuJoCo | {results['clips']['count']} | {hidden} |"]
    for paper in dict.fromkeys(entry.paper for entry in entries):
        c = CONDITIONS[paper]
        rows.append(f"| {paper} | about {c.samples:,.0f} | {c.simulator} | {c.clips} | {c.networks} |")
    return ["| | samples | simulator | clips | policy's layers |", "|---|---:|---|---:|---|", *rows]


def _ages(ages: dict[str, Any]) -> str:
    """The episodes of the policy at three ages."""
    if not ages:
        return ""
    rows = [
        f"| {AGES[age]} | {m['length']:.1f} | {m['fall_rate']:.2f} | {m['score']:.3f} | {m['episodes']} |"
        for age, m in ages.items()
    ]
    return "\n".join(
        [
            "## Episodes",
            "",
            "Started in a clip, until a fall or the clock; the score is the trained discriminator's.",
            "",
            "| policy | length [steps] | fall rate | style score | episodes |",
            "|---|---:|---:|---:|---:|",
            *rows,
        ]
    )


def _pictures(folder: Path, pictures: list[tuple[str, Path]]) -> str:
    if not pictures:
        return ""
    shown = [f"![{caption}]({path.relative_to(folder).as_posix()})\n\n*{caption}.*" for caption, path in pictures]
    return "\n\n".join(["## Pictures", *shown])


def _meanings(results: dict[str, Any]) -> str:
    lines = []
    for metric in _shown(results):
        entry = results["metrics"][metric.name]
        protocols = f" Recorded: {'; '.join(entry['protocols'])}." if entry["protocols"] else ""
        lines.append(f"- **{metric.title}**: {metric.meaning}{protocols} Judged in {entry['seconds']:.1f} s.")
    return "\n".join(["## What the figures mean", "", *lines])


def _left_out(left_out: dict[str, str]) -> str:
    if not left_out:
        return ""
    return "\n".join(["## Left out", "", *(f"- `{name}`: {reason}" for name, reason in left_out.items())])


def _going_on(folder: Path) -> str:
    return "\n".join(
        [
            "## How to go on",
            "",
            "```",
            "# every metric, on as many trajectories as the papers have; it can be stopped and taken up again",
            f"murmillo evaluate run={folder} metrics=all trajectories=10000",
            "```",
        ]
    )
