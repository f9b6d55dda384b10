"""What a run of the benchmarks has found: figures and ratios, as JSON for the gate and as a table to read."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from murmillo.cli import versions
from murmillo.cli.benching.turns import Spread
from murmillo.cli.runs import write_json, write_text

FOLDER = Path("benchmarks/results")
JSON = "benchmarks.json"
MARKDOWN = "benchmarks.md"
_PACKAGES = ("mujoco", "torch", "gymnasium", "numpy", "envpool", "mujoco-warp")


@dataclass(frozen=True)
class Figure:
    """What was measured.

    Attributes:
        name: of what was run.
        value: so many a second, if the unit says nothing else.
        unit: "control steps/s", "samples/s", "MB", "s".
        note: under which conditions.
        physics: what a control step is: substeps, degrees of freedom, contacts.
    """

    name: str
    value: float
    unit: str
    note: str = ""
    physics: str = ""


@dataclass
class Record:
    """All of a run.

    Attributes:
        load: processes that wanted to run in the minute before, by the system; an idle machine has nearly 0.
        quick: it was a trial of the benchmarks themselves, whose figures mean nothing.
        figures: in the order of the run.
        ratios: of what was measured in turns, by name; more is better.
        left_out: why a ratio could not be measured here, by its name.
    """

    load: float
    quick: bool
    figures: list[Figure] = field(default_factory=list)
    ratios: dict[str, Spread] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        return {
            "machine": versions.machine(),
            "packages": versions.package_versions(_PACKAGES),
            **asdict(self),
        }

    def markdown(self) -> str:
        """The figures, the ratios and what was left out, with machine and versions."""
        packages = versions.package_versions(_PACKAGES)
        known = ", ".join(f"{name} {found}" for name, found in packages.items() if found)
        machine = versions.machine()
        gpu = f", {machine['gpu']}" if machine["gpu"] else ""
        lines = [
            f"{machine['processor']}, {machine['cores']} cores{gpu}; Python {machine['python']}, {known}; "
            f"load before the run {self.load:.1f}",
        ]
        if self.quick:
            lines += ["", "**A quick trial: the figures mean nothing.**"]
        lines += ["", "| what | | unit | physics | note |", "|---|---:|---|---|---|"]
        lines += [f"| {f.name} | {_number(f.value)} | {f.unit} | {f.physics} | {f.note} |" for f in self.figures]
        lines += ["", "| ratio of rates within a round | median (range) |", "|---|---:|"]
        lines += [f"| {name} | {spread} |" for name, spread in self.ratios.items()]
        if self.left_out:
            lines += ["", *(f"- left out: {name}: {reason}" for name, reason in self.left_out.items())]
        return "\n".join(lines) + "\n"

    def save(self, folder: Path) -> None:
        """Write both files."""
        folder.mkdir(parents=True, exist_ok=True)
        write_json(folder / JSON, self.as_json())
        write_text(folder / MARKDOWN, self.markdown())


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
