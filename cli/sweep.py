"""`murmillo train --multirun`: hydra's sweeper and launcher start one run for each combination of values."""

import itertools
import sys
from collections.abc import Iterator
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import OverrideParseException

from murmillo.cli.config import compose_train, register, typed
from murmillo.cli.errors import user_errors
from murmillo.cli.launchers import chosen, shared_out
from murmillo.cli.training import train
from murmillo.cli.translate import command_error

CHECKED_COMBINATIONS = 1000
"""So many are composed before the first run starts; a mistake in a later one shows when its turn comes."""


def sweep(words: list[str]) -> int:
    """Check every combination, then run them all through hydra, whose launcher decides where."""
    launcher = chosen(words)
    for combination in itertools.islice(combinations(words), CHECKED_COMBINATIONS):
        compose_train(list(combination))
    words = shared_out(words, launcher, sum(1 for _ in combinations(words)))
    register()
    arguments, sys.argv = sys.argv, [sys.argv[0], "--multirun", *words]  # hydra reads the command line itself
    try:
        hydra.main(version_base="1.3", config_path="pkg://murmillo.conf", config_name="config")(_job)()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else 1
    finally:
        sys.argv = arguments
    return 0


def combinations(words: list[str]) -> Iterator[tuple[str, ...]]:
    """The overrides of each run: `a=1,2 b=3` gives (a=1, b=3) and (a=2, b=3). Hydra's own settings are left out."""
    try:
        overrides = OverridesParser.create().parse_overrides([word for word in words if not _is_hydras(word)])
    except OverrideParseException as error:
        raise command_error(error, None) from None
    choices = []
    for override in overrides:
        if override.is_sweep_override():
            key = override.get_key_element()
            choices.append([f"{key}={value}" for value in override.sweep_string_iterator()])
        else:
            choices.append([override.input_line or ""])
    return itertools.product(*choices)


def _is_hydras(word: str) -> bool:
    return word.lstrip("+~").startswith(("hydra.", "hydra/"))


def _job(composed: Any) -> None:
    """One run of a sweep, in whatever process the launcher chose. A user's mistake ends the sweep with status 2."""
    job = HydraConfig.get()
    config = typed(composed, dict(job.runtime.choices))
    print(f"run {job.job.num}: {job.job.override_dirname or 'no overrides'}", flush=True)
    try:
        train(config, suffix=f"-{job.job.num}")
    except user_errors() as error:
        print(f"murmillo: run {job.job.num}: {error}", file=sys.stderr)
        sys.exit(2)
