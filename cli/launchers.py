"""Hydra's launchers, which decide where the runs of a sweep go, and how many of them share this machine's cores."""

from importlib.util import find_spec
from typing import NamedTuple

from murmillo.cli import versions
from murmillo.cli.errors import CommandError, near_names

CHOICE = "hydra/launcher="


class Launcher(NamedTuple):
    """A launcher of hydra's by its name; `conf/launcher` has the settings that differ from the plugin's.

    Attributes:
        plugin: the module of hydra's that it needs.
        package: what to install for it.
    """

    plugin: str
    package: str


_SWEEPS = "murmillo[sweeps]"
LAUNCHERS = {
    "joblib": Launcher("hydra_joblib_launcher", _SWEEPS),
    "submitit_local": Launcher("hydra_submitit_launcher", _SWEEPS),
    "submitit_slurm": Launcher("hydra_submitit_launcher", _SWEEPS),
    "ray": Launcher("hydra_ray_launcher", "hydra-ray-launcher"),
}


def chosen(words: list[str]) -> str | None:
    """The launcher that these words of the command line choose; None is hydra's own, one run after the other.

    Raises:
        CommandError: there is none of that name, or its plugin is not installed.
    """
    names = [word.removeprefix(CHOICE) for word in words if word.startswith(CHOICE)]
    if not names or names[-1] == "basic":
        return None
    name = names[-1]
    if name not in LAUNCHERS:
        raise CommandError(f"{CHOICE}{name}: there is no such launcher; {near_names(name, ['basic', *LAUNCHERS])}")
    launcher = LAUNCHERS[name]
    if find_spec("hydra_plugins") is None or find_spec(f"hydra_plugins.{launcher.plugin}") is None:
        raise CommandError(f"{CHOICE}{name}: its plugin is not installed; pip install '{launcher.package}'")
    return name


def shared_out(words: list[str], launcher: str | None, runs: int) -> list[str]:
    """The words, with what they leave open of how so many runs share this machine.

    A run's `threads` are its share of the cores: of the runs at a time (joblib), of all (submitit_local), of what ray
    gives it. Slurm gives each job cores of its own.

    Raises:
        CommandError: joblib's number of runs at a time is none.
    """
    settings = dict(word.split("=", 1) for word in words if "=" in word)
    cores, added = versions.usable_cores(), {}
    if launcher == "joblib":
        at_a_time = min(runs, cores)
        given = settings.get("hydra.launcher.n_jobs", str(at_a_time))
        if not given.isdecimal() or given == "0":
            raise CommandError(f"hydra.launcher.n_jobs={given}: needs a number of runs at a time, at least 1")
        added = {"hydra.launcher.n_jobs": given, "threads": str(max(1, cores // int(given)))}
    elif launcher == "submitit_local":
        added = {"threads": str(max(1, cores // runs))}
    elif launcher == "ray":
        added = {"threads": settings.get("hydra.launcher.ray.remote.num_cpus", "2")}
    ours = [] if launcher is None else [f"+launcher={launcher}"]
    return [*words, *ours, *(f"{name}={value}" for name, value in added.items() if name not in settings)]
