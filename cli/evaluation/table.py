"""The metrics by name: what each is, how it is recorded, what it needs, and which figures it gives."""

from collections.abc import Callable
from typing import NamedTuple

from murmillo.cli.errors import CommandError, near_names
from murmillo.cli.evaluation import judging
from murmillo.cli.evaluation.figures import Outcome
from murmillo.cli.evaluation.protocols import HELD, PUSHED, SWITCHED, SWITCHED_ASE, Protocol
from murmillo.cli.evaluation.scene import Evidence

QUICK, ALL = "quick", "all"

COMMANDS = "commands"
ENCODER = "encoder"
RESIDUAL = "residual"
NEEDS = {
    COMMANDS: "an agent that is told a label, of two or more, or a motion: agent=case or agent=calm",
    ENCODER: "an agent that encodes motions: agent=calm",
    RESIDUAL: "residual forces: env.residual_force above 0",
}


class FigureKind(NamedTuple):
    """A figure of a metric.

    Attributes:
        name: in `metrics.json`.
        title: for a reader.
        unit: "%" shows a share times 100.
        digits: behind the point.
        better: "up", "down" or "", which way is good.
    """

    name: str
    title: str
    unit: str
    digits: int
    better: str = ""

    def show(self, value: float | None, spread: float | None = None) -> str:
        """As text with its unit, a dash where there is none."""
        if value is None or value != value:
            return "-"
        scale = 100.0 if self.unit == "%" else 1.0
        deviation = "" if spread is None else f" ± {scale * spread:.{self.digits}f}"
        return f"{scale * value:.{self.digits}f}{deviation}{f' {self.unit}' if self.unit else ''}"


class Metric(NamedTuple):
    """A metric.

    Attributes:
        name: on the command line.
        title: for a reader.
        meaning: in a sentence or two, with its source.
        protocols: that it judges recordings of.
        figures: that it gives.
        judge: its function.
        need: a key of `NEEDS`, or "".
        quick: whether it is in the quick set.
    """

    name: str
    title: str
    meaning: str
    protocols: tuple[Protocol, ...]
    figures: tuple[FigureKind, ...]
    judge: Callable[[Evidence], Outcome | None]
    need: str = ""
    quick: bool = False


METRICS = {
    metric.name: metric
    for metric in (
        Metric(
            "coverage",
            "Motion coverage",
            "The share of the distinct clips that a trajectory is like: its majority of transitions is nearest to the "
            "clip (ASE, eq. 22). Filtered, a clip counts if it is matched more often than that share of its even part "
            "of the trajectories (C·ASE, eqs. 8 and 9): ten trajectories a clip are the fewest for 10 % to filter any.",
            (HELD,),
            (
                FigureKind("coverage", "Coverage", "%", 1, "up"),
                FigureKind("coverage_10", "Coverage, filter 10 %", "%", 1, "up"),
                FigureKind("coverage_20", "Coverage, filter 20 %", "%", 1, "up"),
                FigureKind("coverage_50", "Coverage, filter 50 %", "%", 1, "up"),
            ),
            judging.coverage,
            quick=True,
        ),
        Metric(
            "transitions",
            "Transition coverage",
            "The share of all ordered pairs of clips that appear when the command changes on the way: the clip before, "
            "the clip after (ASE, section 10.4; C·ASE, section 5). It cannot be more than trajectories over pairs.",
            (SWITCHED, SWITCHED_ASE),
            (
                FigureKind("transitions", "Transitions, 200 + 200 steps", "%", 2, "up"),
                FigureKind("transitions_ase", "Transitions, 150-200 of 300", "%", 2, "up"),
            ),
            judging.transitions,
        ),
        Metric(
            "frechet",
            "Fréchet distance",
            "Between the raw features of the motions and of the clips, of frames, transitions and 30-frame clips "
            "(C·ASE, table 1), one of each a trajectory. Few samples of many features raise it: the replayed clips "
            "show by how much.",
            (HELD,),
            (
                FigureKind("frechet_1", "Fréchet distance, frames", "", 1, "down"),
                FigureKind("frechet_2", "Fréchet distance, transitions", "", 1, "down"),
                FigureKind("frechet_30", "Fréchet distance, 30-frame clips", "", 1, "down"),
            ),
            judging.frechet,
            quick=True,
        ),
        Metric(
            "diversity",
            "Diversity",
            "Average distance of two motions of 30 frames (C·ASE, eq. 10); from 1,000 trajectories on the mean and "
            "deviation of ten draws. Wild motions are diverse too: read it beside the Fréchet distance.",
            (HELD,),
            (FigureKind("pairwise_distance", "Average pairwise distance", "", 1, "up"),),
            judging.diversity,
            quick=True,
        ),
        Metric(
            "concentration",
            "Latent space",
            "Fisher concentration of the encodings of windows that slide over the clips (CALM, eq. 9): 1 means that "
            "clips do not matter. The maps show the same encodings.",
            (),
            (FigureKind("concentration", "Fisher concentration", "", 3, "down"),),
            judging.concentration,
            need=ENCODER,
            quick=True,
        ),
        Metric(
            "inception",
            "Inception score",
            "How sure a classifier of the clips is of each motion, and how many clips it sees (CALM, section 8.1); the "
            "classifier is trained here on parts of the clips, its accuracy is on the rest of them.",
            (HELD,),
            (
                FigureKind("inception", "Inception score", "", 2, "up"),
                FigureKind("classifier_accuracy", "Classifier, held-out accuracy", "%", 1),
            ),
            judging.inception,
        ),
        Metric(
            "controllability",
            "Controllability",
            "The share of motions in which that classifier sees the clip or the label that was commanded: a stand-in "
            "for the human raters of CALM, section 8.1.",
            (HELD,),
            (FigureKind("controllability", "Seen as commanded", "%", 1, "up"),),
            judging.controllability,
            need=COMMANDS,
        ),
        Metric(
            "residual",
            "Residual forces",
            "All residual forces [N] over all torques of the PD control [N m] (C·ASE, section 4.2).",
            (HELD,),
            (FigureKind("residual_share", "Residual forces over PD torques", "%", 3, "down"),),
            judging.residual,
            need=RESIDUAL,
            quick=True,
        ),
        Metric(
            "quality",
            "Quality of motion",
            "Plain signs that no paper reports: speed of standing feet, jerk of the key points, power of the "
            "actuators, and the share of steps with more than the feet on the ground.",
            (HELD,),
            (
                FigureKind("foot_slide", "Foot slide", "m/s", 3, "down"),
                FigureKind("jerk", "Jerk", "m/s³", 0, "down"),
                FigureKind("power", "Power", "W", 0, "down"),
                FigureKind("on_ground", "Steps on the ground", "%", 1, "down"),
            ),
            judging.quality,
            quick=True,
        ),
        Metric(
            "recovery",
            "Recovery",
            "Pushed by 500 to 1,000 N, a character that fell has recovered once its root is above 0.5 m and its head "
            "above 1 m (ASE, section 10.7).",
            (PUSHED,),
            (
                FigureKind("recovered", "Recovered of the fallen", "%", 1, "up"),
                FigureKind("recovery_mean", "Time to recover, mean", "s", 2, "down"),
                FigureKind("recovery_max", "Time to recover, longest", "s", 1, "down"),
                FigureKind("fell", "Fell when pushed", "%", 1, "down"),
            ),
            judging.recovery,
        ),
    )
}


def choose(names: tuple[str, ...], has: set[str]) -> tuple[list[Metric], dict[str, str]]:
    """The metrics of these names, and the reasons for those of a set that are left out.

    Args:
        names: of metrics, or of the sets "quick" and "all".
        has: the keys of `NEEDS` that the run's agent can give.

    Raises:
        CommandError: an unknown name, or a metric that was asked for by name and cannot be.
    """
    for name in names:
        if name not in (*METRICS, QUICK, ALL):
            raise CommandError(f"metrics=[{name}]: no such metric; {near_names(name, [*METRICS, QUICK, ALL])}")
        if name in METRICS and METRICS[name].need not in ("", *has):
            raise CommandError(f"metrics=[{name}]: needs {NEEDS[METRICS[name].need]}; this run has none")
    wanted = [
        metric
        for metric in METRICS.values()
        if metric.name in names or ALL in names or (metric.quick and QUICK in names)
    ]
    left_out = {m.name: f"needs {NEEDS[m.need]}" for m in wanted if m.need not in ("", *has)}
    return [metric for metric in wanted if metric.name not in left_out], left_out
