"""The report's section on an agent that is told its skill: does it do as told, and which skills does it practise?"""

from typing import Any

from murmillo.cli.rollouts import AGES


def section(measures: dict[str, Any], skills: dict[str, dict[str, float]]) -> str:
    """Markdown, empty for an agent without labels.

    Args:
        measures: of the policy's ages, with the mean scores that the discriminator's heads gave (`Measures.heads`).
        skills: figures of each skill by name: the share of the practice that it gets, its score, and what it has left
            of residual forces, if there are any.
    """
    heads = {age: measured["heads"] for age, measured in measures.items() if measured.get("heads")}
    if not heads and not skills:
        return ""
    return "\n\n".join(["## Does it do as it is told?", *filter(None, (_heads(heads), _skills(skills)))])


def _heads(heads: dict[str, dict[str, float]]) -> str:
    if not heads:
        return ""
    rows = [f"| {AGES[age]} | {h['right']:.3f} | {_figure(h.get('other'))} |" for age, h in heads.items()]
    return "\n".join(
        [
            "In the same episodes: the score, 0 to 1, that the trained discriminator's head of the commanded skill "
            "gives to the motion, and the mean of what the heads of all other skills give to it. A policy that obeys "
            "has the first well above the second.",
            "",
            "| policy | head of the commanded skill | other heads |",
            "|---|---:|---:|",
            *rows,
        ]
    )


def _skills(skills: dict[str, dict[str, float]]) -> str:
    if not skills:
        return ""
    hardest_first = sorted(skills.items(), key=lambda item: -item[1]["share"])
    text = (
        f"Focal sampling gives each skill a share of the practice; an even one is {100 / len(skills):.2f} %. The "
        "score is the discriminator's mean for the agent's motion under this label being a clip of it."
    )
    table = ["| skill | share of the practice | score |", "|---|---:|---:|"]
    table += [f"| {name} | {100 * s['share']:.2f} % | {s['score']:.3f} |" for name, s in hardest_first]
    if all("forces" in skill for skill in skills.values()):
        text += " Forces are what the skill has left of the residual forces that it began with."
        left = [" forces |", "---:|", *(f" {s['forces']:.2f} |" for _, s in hardest_first)]
        table = [row + cell for row, cell in zip(table, left, strict=True)]
    return "\n".join([text, "", *table])


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
