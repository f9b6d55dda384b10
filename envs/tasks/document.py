"""The table of the suite's ids, `docs/tasks.md`, from the tasks themselves: python -m murmillo.envs.tasks.document"""

import inspect
import re
import sys
from dataclasses import fields
from pathlib import Path

from murmillo.envs.character import load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.observations import state_dim
from murmillo.envs.tasks import TASKS, Task

PAGE = Path("docs/tasks.md")
"""Where the page lies, from the repository's root."""

_INTRODUCTION = """\
# Tasks

Made by `python -m murmillo.envs.tasks.document` from `murmillo.envs.tasks.TASKS`; change the tasks, not this page.

Every id takes `gymnasium.make("murmillo/<Task>-v0", ...)` for one world and `gymnasium.make_vec` for many, after
`import murmillo.envs`. Arguments of a task go into `task={{...}}`; all ids share those of `murmillo.envs.EnvConfig`.

| what | in every id |
|---|---|
| observation `state` | {state} numbers, the table in `murmillo.envs.observations.character_state`, heading frame |
| observation `skill` | the commanded skill, an index into `env.unwrapped.skills` |
| observation `window` | with `window=W` above 1: the last W states, oldest first |
| with `features="links"` | `state`, `length` and `window` are those of `murmillo.envs.features.LinkFeatures` |
| observation `goal` | of the tasks that have one, below; the number of columns of each part is in brackets |
| action | {action} numbers in [-1, 1]: PD targets of the joints (with `residual_force`, 45 more) |
| reward | the sum of the task's terms, by name in `info["reward_terms"]` |
| end | `terminated` by what the table says, `truncated` after `episode_steps`, the clock |
| step | 1/30 s |

The heading frame has its origin at the root and turns with the root's yaw alone; x is ahead, y to the left, z up.
"""


def page() -> str:
    """The whole page, as Markdown.

    Raises:
        SuiteError: an argument of a task that its dataclass does not describe.
    """
    character = load_character()
    introduction = _INTRODUCTION.format(state=state_dim(character), action=character.action_dim)
    overview = ["| id | goal | reward of a step | end | skill |", "|---|---|---|---|---|"]
    sections = []
    for name, cls in TASKS.items():
        task = cls(cls.config_type()) if cls.config_type else cls()  # type: ignore[call-arg]  those with arguments take them
        low, high = task.reward_range
        skill = f"another every {task.skill_steps} steps" if task.skill_steps else "one an episode"
        goal = f"{task.goal_dim} numbers" if task.goal_dim else "none"
        overview.append(f"| [{name}](#{name.lower()}) | {goal} | {low:g} to {high:g} | {task.end_doc} | {skill} |")
        sections.append(_section(name, task))
    return "\n".join([introduction, *overview, "", "\n".join(sections)])


def write(path: Path = PAGE) -> None:
    """Write the page to this file."""
    path.write_text(page(), encoding="utf-8")


def _section(name: str, task: Task) -> str:
    goal = f"{task.goal_dim} numbers: {task.goal_doc}" if task.goal_dim else "none"
    low, high = task.reward_range
    lines = [
        f"## {name}",
        "",
        inspect.cleandoc(type(task).__doc__ or ""),
        "",
        f"- id: `murmillo/{name}-v0`",
        f"- goal: {goal}",
        f"- reward: {task.reward_doc}",
        f"- reward of a step: from {low:g} to {high:g}, by which returns are normalised",
        f"- end: {task.end_doc}",
        *_settings(task),
        "",
    ]
    if task.config_type is None:
        return "\n".join([*lines, "It takes no arguments of its own.", ""])
    described = _descriptions(task.config_type)
    lines += ["| argument | default | meaning |", "|---|---|---|"]
    example = task.config_type()
    for field in fields(task.config_type):
        if field.name not in described:
            raise SuiteError(f"{name}: argument {field.name} has no line under Attributes: in its dataclass; add one")
        lines.append(f"| `{field.name}` | `{getattr(example, field.name)!r}` | {_cell(described[field.name])} |")
    return "\n".join([*lines, ""])


def _settings(task: Task) -> list[str]:
    """A line on where the id differs from the defaults of `EnvConfig`."""
    said = ", ".join(f"`{name}={value!r}`" for name, value in task.settings.items())
    return [f"- settings, unless told otherwise: {said}"] if said else []


def _descriptions(config_type: type) -> dict[str, str]:
    """What the section `Attributes:` of a dataclass's docstring says of each name."""
    _, _, attributes = inspect.cleandoc(config_type.__doc__ or "").partition("Attributes:\n")
    entries = re.findall(r"^    (\w[\w, ]*): (.*(?:\n {5,}.*)*)", attributes, flags=re.MULTILINE)
    return {name: " ".join(text.split()) for names, text in entries for name in names.split(", ")}


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else PAGE)
