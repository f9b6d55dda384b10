"""A training that torchrun has spread over several processes: what they agree on, and how a restart finds its run."""

import dataclasses
import io
import os
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from shutil import rmtree
from typing import Any, TypeVar

import torch
from omegaconf import OmegaConf

from murmillo.agents.common.ranks import Ranks, joined
from murmillo.cli import runs, versions
from murmillo.cli.errors import CommandError, user_errors
from murmillo.envs import EnvConfig

STATUS = 2
"""Of a rank that ends because of a mistake which the first one tells."""

T = TypeVar("T")


@contextmanager
def launched() -> Iterator[Ranks]:
    """The ranks of this run. All but the first are silent, but for what goes wrong with them alone."""
    with joined() as ranks:
        if ranks.first:
            yield ranks
            return
        try:
            with redirect_stdout(_Nowhere()):
                yield ranks
        except user_errors() as error:
            print(f"murmillo: rank {ranks.rank} of {ranks.size}: {error}", file=sys.stderr)
            raise SystemExit(STATUS) from None


class _Nowhere(io.TextIOBase):
    """Takes all that is written."""

    def write(self, text: str) -> int:
        return len(text)


def agreed(ranks: Ranks, prepare: Callable[[], T]) -> T:
    """The settings that every rank has prepared.

    Raises:
        CommandError: one of them cannot be, or they are not the same. The first rank tells it, the others end.
    """
    settings = mistake = None
    try:
        settings = prepare()
        _check_worlds(settings, ranks)
    except user_errors() as error:
        if ranks.size == 1:
            raise
        mistake = str(error)
    mistakes = ranks.gather(mistake)
    if mistakes[0] is not None:
        _end(ranks, mistakes[0])
    for rank, text in enumerate(mistakes):
        if text is not None:
            _end(ranks, f"rank {rank} of {ranks.size}: {text}")
    all_settings = [_flat(dataclasses.asdict(each)) for each in ranks.gather(settings)]  # type: ignore[call-overload]
    for rank, theirs in enumerate(all_settings):
        for name, value in all_settings[0].items():
            if theirs.get(name) != value:
                _end(
                    ranks,
                    f"{name}={theirs.get(name)}: so says rank {rank}, but rank 0 has {value}; start all ranks with "
                    "the same command and the same version",
                )
    assert settings is not None
    return settings


def decided(ranks: Ranks, decide: Callable[[], T]) -> T:
    """What the first rank decides, for all; its mistake ends the others too."""
    value = mistake = None
    if ranks.first:
        try:
            value = decide()
        except user_errors() as error:
            if ranks.size == 1:
                raise
            mistake = str(error)
    value, mistake = ranks.told((value, mistake))
    if mistake is not None:
        _end(ranks, mistake)
    return value  # type: ignore[return-value]


def _end(ranks: Ranks, mistake: str) -> None:
    if ranks.first:
        raise CommandError(mistake)
    raise SystemExit(STATUS)


def _check_worlds(config: Any, ranks: Ranks) -> None:
    if config.num_envs % ranks.size:
        raise CommandError(
            f"num_envs={config.num_envs}: these are the worlds of all ranks, and {ranks.size} cannot share them; "
            f"take a multiple of {ranks.size}"
        )


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested settings by their dotted names."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value}
    return flat


def worlds(config: Any, ranks: Ranks) -> str:
    """How many there are, in words."""
    return f"{config.num_envs} worlds" + (f" over {ranks.size} ranks" if ranks.size > 1 else "")


def share_threads(config: Any) -> EnvConfig:
    """Set torch's threads, and the environment's settings with its own; 0 is every core, which the ranks share."""
    cores = max(1, versions.usable_cores() // int(os.environ.get("LOCAL_WORLD_SIZE", "1")))
    torch.set_num_threads(config.threads or cores)
    return dataclasses.replace(config.env, threads=config.env.threads or cores)


# --- the run's folder ------------------------------------------------------------------------------------------------


def open_run(config: Any, name: str, ranks: Ranks) -> tuple[Path, bool]:
    """The folder of the run and whether it is there already, to be taken up again; the first rank decides.

    That is where the settings name one, and where torchrun starts processes again that had begun one. A new run is
    called `name`.

    Raises:
        CommandError: there cannot be such a run.
    """

    def decide() -> tuple[Path, bool]:
        if config.run.resume is not None:
            return Path(config.run.resume), True
        again = begun(config)
        return (runs.vacant(config.run.root, name), False) if again is None else (again, True)

    folder, resuming = decided(ranks, decide)
    config.run.name = folder.name
    return folder, resuming


def launch_id() -> str | None:
    """What is the same when torchrun starts its processes again: its --rdzv-id, else itself; None without torchrun."""
    given = os.environ.get("TORCHELASTIC_RUN_ID")
    return f"{socket.gethostname()}-{os.getppid()}" if given in ("", "none") else given


def mark(folder: Path) -> None:
    """Note in a run's folder which launch it belongs to."""
    if (launch := launch_id()) is not None:
        runs.write_json(folder / runs.LAUNCH, {"id": launch})


def begun(config: Any) -> Path | None:
    """The run that this launch began with these settings and has not ended, where it left a checkpoint.

    One that left none is taken away: it begins anew.
    """
    if (launch := launch_id()) is None:
        return None
    for path in sorted(Path(config.run.root).glob(f"*/{runs.LAUNCH}"), key=lambda path: path.stat().st_mtime)[::-1]:
        folder = path.parent
        if runs.read_json(path) != {"id": launch} or not _same(config, folder) or (folder / runs.MEASURES).exists():
            continue
        if (folder / runs.LAST).exists():
            return folder
        rmtree(folder)
    return None


def _same(config: Any, folder: Path) -> bool:
    """Whether a run's settings are these, but for where it is kept."""
    settings = {name: value for name, value in dataclasses.asdict(config).items() if name != "run"}
    text = (folder / runs.CONFIG).read_text(encoding="utf-8") if (folder / runs.CONFIG).is_file() else ""
    saved = OmegaConf.to_container(OmegaConf.create(text))
    assert isinstance(saved, dict)
    saved.pop("run", None)
    return OmegaConf.to_yaml(OmegaConf.create(settings)) == OmegaConf.to_yaml(OmegaConf.create(saved))
