"""The table of what an import did, for the terminal and as Markdown."""

from collections.abc import Sequence

from murmillo.cli.motions.convert import Made

COLUMNS = (
    "clip",
    "skeleton",
    "seconds",
    "error mean [cm]",
    "error max [cm]",
    "slide before [cm]",
    "after",
    "depth before [cm]",
    "after",
    "findings",
)
LEFT = ("clip", "skeleton", "findings")

MEANING = (
    "error: distance of hands and feet from where the recording, in the character's size, has them; "
    "slide: mean way of a standing foot in a frame; depth: how deep the body is below the ground; "
    "before: in the pose that copies the recording's rotations. skeleton own: the character's, which was only copied."
)


def common_findings(made: Sequence[Made]) -> dict[str, str]:
    """What was found out about every file alike."""
    if not made:
        return {}
    first, *others = (one.findings for one in made)
    return {name: text for name, text in first.items() if all(other.get(name) == text for other in others)}


def rows(made: Sequence[Made]) -> list[tuple[str, ...]]:
    """The cells of each clip; findings that all share are left out."""
    common = common_findings(made)
    return [_row(one, common) for one in made]


def _row(one: Made, common: dict[str, str]) -> tuple[str, ...]:
    fit = one.fit
    figures = (fit.error_mean, fit.error_max, fit.before.slide, fit.after.slide, fit.before.depth, fit.after.depth)
    own = [described(name, text) for name, text in one.findings.items() if name not in common]
    return (
        one.clip.name,
        fit.skeleton,
        f"{one.clip.duration:.2f}",
        *(f"{100 * figure:.1f}" for figure in figures),
        ", ".join(own),
    )


def described(name: str, text: str) -> str:
    """A finding in words: `up: y (format)`."""
    return f"{name}: {text}"


def markdown(made: Sequence[Made], failures: Sequence[str]) -> str:
    """The whole report."""
    lines = [
        "# Imported motions",
        "",
        f"{len(made)} clips, {sum(one.clip.duration for one in made):.1f} s. {MEANING}",
        "",
    ]
    lines += [f"- {described(name, text)}" for name, text in common_findings(made).items()]
    lines += ["", _line(COLUMNS), _line(["---" if column in LEFT else "---:" for column in COLUMNS])]
    lines += [_line(row) for row in rows(made)]
    if failures:
        lines += ["", "Not imported:", "", *(f"- {failure}" for failure in failures)]
    return "\n".join(lines) + "\n"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"
