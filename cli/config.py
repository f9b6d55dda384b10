"""The settings of `murmillo train`: hydra puts them together from `conf/`, the dataclasses of the rooms check them."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

from hydra import compose, initialize_config_module
from hydra.core.config_store import ConfigStore
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from murmillo.agents.common.guided_start import GuidedStartConfig
from murmillo.agents.common.runner import RunnerConfig
from murmillo.agents.common.warm_start import WarmStartConfig
from murmillo.cli import runs
from murmillo.cli.agents import AGENTS
from murmillo.cli.errors import CommandError
from murmillo.cli.schema import build, schema_of
from murmillo.cli.translate import command_error, unreadable, wrong_name
from murmillo.envs import EnvConfig

GROUPS = ("agent", "budget", "ablation", "to")
RESUMABLE = ("run.", "runner.", "threads=", "matmul=")
"""What may be set anew when a run is taken up again; everything else is the run's own."""

T = TypeVar("T")


@dataclass
class RunConfig:
    """Where a run is kept.

    Attributes:
        root: folder of the runs.
        name: the run's folder in it; by default the time, the agent, the budget and the seed.
        resume: folder of a run to take up again, with its own settings.
        measured_worlds: episodes that the policy is measured in at the end, and trajectories of its evaluation.
        evaluate: measure the quick metrics of `murmillo evaluate` at the end.
        keep_every: samples after which a checkpoint is kept for `murmillo evaluate checkpoint=all`; None keeps none.
        video: film the trained character at the end.
    """

    root: str = "runs"
    name: str | None = None
    resume: str | None = None
    measured_worlds: int = 64
    evaluate: bool = True
    keep_every: int | None = None
    video: bool = True


@dataclass
class TrainConfig:
    """All settings of a run.

    Attributes:
        agent: the chosen agent's configuration.
        choices: the files of `conf/` that this was put together from, by group; of a merged run also what it was merged
            of.
        base: folder of the run whose policy is adapted; None learns from nothing. Its settings are those of this run.
        motions: "builtin", a folder of clips or one file.
        clips: names of those of them that are learned, or patterns such as "walk_*"; empty for all.
        skills: how many labels the clips must have; None takes what they have.
        num_envs: worlds that are simulated together.
        seed: of everything random.
        physics: what simulates, "cpu" or "warp" (docs/gpu.md).
        device: where it learns: "auto" is the CPU, of "warp" the first GPU; "cuda:1" and the like, or "cpu".
        matmul: how exact float32 products of matrices are while it learns: "highest"; "tf32" on a GPU that has it;
            "bf16" in the trunks of discriminators alone; "auto" is bf16 on a processor with units for it, else highest.
        threads: CPU threads; 0 takes every core that the process may use.
    """

    agent: Any
    env: EnvConfig = field(default_factory=EnvConfig)
    runner: RunnerConfig = field(default_factory=RunnerConfig)
    warm_start: WarmStartConfig = field(default_factory=WarmStartConfig)
    guided_start: GuidedStartConfig = field(default_factory=GuidedStartConfig)
    run: RunConfig = field(default_factory=RunConfig)
    choices: dict[str, str] = field(default_factory=dict)
    base: str | None = None
    motions: str = "builtin"
    clips: tuple[str, ...] = ()
    skills: int | None = None
    num_envs: int = 4096
    seed: int = 1
    physics: Literal["cpu", "warp"] = "cpu"
    device: str = "auto"
    matmul: Literal["auto", "highest", "tf32", "bf16"] = "auto"
    threads: int = 0


def register() -> None:
    """Tell hydra the schemas which the files of `conf/` are checked against."""
    store = ConfigStore.instance()
    store.store(name="train_schema", node=schema_of(TrainConfig))
    for name, kind in AGENTS.items():
        store.store(group="agent", name=f"{name}_schema", node=schema_of(kind.config))


def compose_train(words: list[str]) -> TrainConfig:
    """The settings that these words of the command line ask for.

    Raises:
        CommandError: a word that cannot be, in one line with what would be right.
    """
    check_words(words)
    if (resumed := resumed_run(words)) is not None:
        return resume(resumed, words, load, RESUMABLE)
    composed, choices = compose_words(words)
    return typed(composed, choices)


def typed(composed: DictConfig, choices: Mapping[str, Any]) -> TrainConfig:
    """The dataclasses of a composed configuration; `choices` are hydra's, by group."""
    values = resolved(composed)
    chosen = {group: str(choices[group]) for group in (*GROUPS, runs.MERGED) if group in choices}
    values["agent"] = build(AGENTS[chosen["agent"]].config, values["agent"], "agent.")
    return build(TrainConfig, {**values, "choices": chosen})


def resolved(composed: DictConfig) -> dict[str, Any]:
    """The plain values of a composed configuration. Raises CommandError where one is missing."""
    try:
        values: Any = OmegaConf.to_container(composed, resolve=True, throw_on_missing=True, enum_to_str=True)
    except OmegaConfBaseException as error:
        raise command_error(error, composed) from None
    return values


def save(config: Any, folder: Path) -> None:
    """Write `config.yaml`: every setting, resolved."""
    runs.write_text(folder / runs.CONFIG, OmegaConf.to_yaml(OmegaConf.create(dataclasses.asdict(config))))


def load(folder: Path, words: list[str] | None = None) -> TrainConfig:
    """The settings of a run, with those of `words` (name=value) laid over them.

    Raises:
        CommandError: the file is no configuration of this version.
    """
    with reading(folder) as (saved, choices):
        if choices.get("agent") not in AGENTS:
            raise CommandError(f"choices.agent: is none of {', '.join(AGENTS)}; copy the file of the run anew")
        composed, _ = compose_words([f"agent={choices['agent']}"])
        return typed(merge(composed, saved, words or []), choices)


@contextmanager
def reading(folder: Path) -> Iterator[tuple[DictConfig, Mapping[str, Any]]]:
    """The settings that a run kept and the choices they come from; what is wrong with them names the file.

    Raises:
        CommandError: there is no configuration in the file, or what is made of it inside fails.
    """
    path = folder / runs.CONFIG
    try:
        saved = OmegaConf.load(path)
        choices = saved.pop("choices") if isinstance(saved, DictConfig) and "choices" in saved else None
        yield cast(DictConfig, saved), choices if isinstance(choices, DictConfig) else {}
    except CommandError as error:
        raise CommandError(f"{path}: {error}") from None
    except (OSError, ValueError, YAMLError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CommandError(f"{path}: no configuration that can be read ({reason})") from None


def parse(cls: type[T], words: list[str]) -> T:
    """The dataclass of a command that has few settings, from words name=value.

    Raises:
        CommandError: a word that cannot be, in one line with what would be right.
    """
    known = OmegaConf.structured(schema_of(cls))
    names = [f.name for f in dataclasses.fields(cls)]  # type: ignore[arg-type]
    for word in words:
        name, equals, _ = word.partition("=")
        if not equals:
            raise CommandError(f"{word}: settings are written name=value, with the names {', '.join(names)}")
        if name not in names:
            raise wrong_name(name, names)
    values = merge(known, OmegaConf.create(), words)
    try:
        missing = sorted(OmegaConf.missing_keys(values))
        plain: Any = OmegaConf.to_container(values, resolve=True, enum_to_str=True)
    except OmegaConfBaseException as error:
        raise command_error(error, known) from None
    if missing:
        raise CommandError(f"{missing[0]}: this setting is needed; write {missing[0]}=…")
    return build(cls, plain)


def compose_words(words: list[str], files: str = "murmillo.conf") -> tuple[DictConfig, Mapping[str, Any]]:
    """Hydra's configuration of these words over the `files` of a package, and its choices by group."""
    register()
    with initialize_config_module(files, version_base="1.3"):
        try:
            composed = compose("config", words, return_hydra_config=True)
        except (HydraException, OmegaConfBaseException, ValueError) as error:
            raise command_error(error, compose("config")) from None
    choices = composed.hydra.runtime.choices
    with open_dict(composed):
        del composed["hydra"]
    return composed, choices


def resumed_run(words: list[str]) -> str | None:
    """The run that is to be taken up again, if any."""
    resumed = [word.split("=", 1)[1] for word in words if word.startswith("run.resume=")]
    return resumed[-1] if resumed and resumed[-1] not in ("null", "") else None


def resume(path: str, words: list[str], load: Callable[[Path, list[str]], T], settable: tuple[str, ...]) -> T:
    """The settings of the run at `path`, as `load` reads them, with those of `words` that may be set anew.

    Raises:
        CommandError: there is no such run, or a word sets what is the run's own.
    """
    folder = runs.existing(path, "run.resume")
    for word in words:
        if not word.startswith(settable):
            names = ", ".join(f"{name}*" if name.endswith(".") else name.rstrip("=") for name in settable)
            raise CommandError(
                f"{word}: a run is taken up again with its own settings, but for {names}; "
                "drop this one, or start a new run"
            )
    config: Any = load(folder, words)
    if (made := config.choices.get(runs.MERGED)) is not None:
        raise CommandError(f"run.resume={path}: this run was merged of {made} and learns no more; take that one up")
    config.run.root, config.run.name = str(folder.parent), folder.name
    return config


def merge(known: DictConfig, saved: Any, words: list[str]) -> DictConfig:
    """What is `known` and set by default, with what was `saved` and then the `words` name=value laid over it.

    Raises:
        CommandError: a name or a value that `known` does not allow.
    """
    OmegaConf.set_struct(known, None)  # hydra locks dicts too, where new names are fine
    try:
        merged = OmegaConf.merge(known, saved, _dotlist(words))
    except OmegaConfBaseException as error:
        raise command_error(error, known) from None
    assert isinstance(merged, DictConfig)
    return merged


def _dotlist(words: list[str]) -> DictConfig:
    for word in words:
        try:
            OmegaConf.from_dotlist([word])
        except YAMLError:
            raise unreadable(word) from None
    return OmegaConf.from_dotlist(words)


def check_words(words: list[str]) -> None:
    """Refuse what hydra would misread, and its `~name`, which takes a setting away."""
    for word in words:
        plain = word.lstrip("+")
        if plain.startswith("~"):
            raise CommandError(f"{word}: settings can be changed, not taken away; write name=value")
        if not plain.partition("=")[0] or "=" not in plain:
            raise CommandError(f"{word}: settings are written name=value; `murmillo train --help` names the first ones")
