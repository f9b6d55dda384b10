"""What the papers report, beside which a run's figures are put.

The figures are the papers' own: ASE (Peng et al. 2022, arXiv 2205.01906), CALM (Tessler et al. 2023, arXiv 2305.02195)
and C·ASE (Dou et al. 2023, arXiv 2309.11351).
"""

from typing import NamedTuple

METHODS = {"ase": "ASE", "calm": "CALM", "case": "C·ASE"}


class Published(NamedTuple):
    """A published figure.

    Attributes:
        figure: name of the `FigureKind`.
        method: that it is of, a key of `METHODS`.
        value: in the unit of the figure, shares from 0 to 1.
        source: paper and place.
        spread: as printed.
        note: what to know before it is compared.
    """

    figure: str
    method: str
    value: float
    source: str
    spread: float | None = None
    note: str = ""

    @property
    def paper(self) -> str:
        """A key of `CONDITIONS`."""
        return self.source.partition(",")[0]


class Conditions(NamedTuple):
    """How the figures of a paper came about.

    Attributes:
        samples: that the policy learned from, about.
        simulator: by name.
        clips: that it learned from.
        networks: hidden layers of the policy.
    """

    samples: float
    simulator: str
    clips: str
    networks: str


_CASE_10 = "10,000 trajectories"
_RATED = "by human raters, 40 clips three times each; here by a classifier"

PUBLISHED = (
    Published("coverage_10", "case", 0.91, "C·ASE, section 5", note=_CASE_10),
    Published("coverage_10", "ase", 0.66, "C·ASE, section 5", note=_CASE_10),
    Published("coverage_10", "calm", 0.71, "C·ASE, section 5", note=f"{_CASE_10}; the text and figure 6 disagree"),
    Published("coverage_20", "ase", 0.57, "C·ASE, section 5", note=_CASE_10),
    Published("coverage_50", "ase", 0.40, "C·ASE, section 5", note=_CASE_10),
    Published("transitions", "case", 0.443, "C·ASE, section 5", note=_CASE_10),
    Published("transitions", "ase", 0.254, "C·ASE, section 5", note=_CASE_10),
    Published("transitions", "calm", 0.284, "C·ASE, section 5", note=_CASE_10),
    Published("transitions_ase", "ase", 0.10, "ASE, section 10.4", note="about 10 %, 1,000 trajectories"),
    Published("frechet_1", "ase", 28.8, "C·ASE, table 1"),
    Published("frechet_1", "calm", 30.1, "C·ASE, table 1"),
    Published("frechet_1", "case", 16.5, "C·ASE, table 1"),
    Published("frechet_2", "ase", 72.3, "C·ASE, table 1"),
    Published("frechet_2", "calm", 69.1, "C·ASE, table 1"),
    Published("frechet_2", "case", 47.4, "C·ASE, table 1"),
    Published("frechet_30", "ase", 1969.8, "C·ASE, table 1"),
    Published("frechet_30", "calm", 1874.6, "C·ASE, table 1"),
    Published("frechet_30", "case", 1742.5, "C·ASE, table 1"),
    Published("pairwise_distance", "ase", 145.4, "C·ASE, eq. 10", 2.11, "ten draws of 10,000; length not stated"),
    Published("pairwise_distance", "calm", 152.7, "C·ASE, eq. 10", 1.86, "ten draws of 10,000; length not stated"),
    Published("pairwise_distance", "case", 160.4, "C·ASE, eq. 10", 1.77, "ten draws of 10,000; length not stated"),
    Published("concentration", "calm", 0.23, "CALM, section 8.1", note="windows of 2 s"),
    Published("concentration", "ase", 0.68, "CALM, section 8.1", note="windows of 2 s"),
    Published("inception", "calm", 19.8, "CALM, section 8.1", 0.1, "160 clips, another classifier"),
    Published("inception", "ase", 18.6, "CALM, section 8.1", 0.4, "160 clips, another classifier"),
    Published("controllability", "calm", 0.78, "CALM, section 8.1", note=_RATED),
    Published("controllability", "ase", 0.35, "CALM, section 8.1", note=_RATED),
    Published("residual_share", "case", 0.00842, "C·ASE, section 4.2", note="1,024 trajectories of 200 steps"),
    Published("recovered", "ase", 1.0, "ASE, section 10.7", note="500 pushes"),
    Published("recovery_mean", "ase", 0.31, "ASE, section 10.7", note="500 pushes"),
    Published("recovery_max", "ase", 4.1, "ASE, section 10.7", note="500 pushes"),
)

CONDITIONS = {
    "ASE": Conditions(10e9, "Isaac Gym", "187", "1024-1024-512"),
    "CALM": Conditions(5e9, "Isaac Gym", "160", "1024-1024-512"),
    "C·ASE": Conditions(1.5e9, "Isaac Gym", "87", "1024-1024-512"),
}
"""By the paper, which may have trained the methods of others anew."""


def published(figure: str, method: str | None = None) -> list[Published]:
    """What there is of a figure, of one method or of all."""
    return [entry for entry in PUBLISHED if entry.figure == figure and method in (None, entry.method)]
