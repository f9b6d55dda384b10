"""Hydra's and OmegaConf's errors as one line: the key, what was wrong, what would be right."""

import re
from typing import Any, get_origin

from hydra.errors import ConfigCompositionException, HydraException, MissingConfigException, OverrideParseException
from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from murmillo.cli.errors import CommandError, near_names

_KINDS = {bool: "true or false", int: "an integer", float: "a number", str: "text"}


def command_error(error: Exception, known: DictConfig | None) -> CommandError:
    """The user's view of an error of composition; `known` is a configuration that composes, for names and examples."""
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, choice = error.missing_cfg_file.rpartition("/")
        options = [name for name in error.options or () if not name.endswith("_schema")]
        return CommandError(f"{group}={choice}: there is no such choice; {near_names(choice, options)}")
    if isinstance(error, OverrideParseException):
        return unreadable(error.override)
    if unfit := re.match(r"In '(\w+)/(\w+)': ConfigKeyError .*full_key: (\S+)", str(error), re.DOTALL):
        group, choice, key = unfit.groups()
        return CommandError(f"{group}={choice}: it sets {key}, which the chosen agent has not; choose another {group}")
    cause = error.__cause__ if isinstance(error, HydraException) and error.__cause__ else error
    if isinstance(cause, (ConfigAttributeError, ConfigKeyError)):
        hint = _near_keys(str(cause.full_key), known)
        if cause.ref_type is not None and get_origin(cause.ref_type) is dict:
            hint = f"{hint}; +{cause.full_key}=… adds it"
        return CommandError(f"{cause.full_key}: there is no such setting; {hint}")
    if isinstance(cause, OmegaConfBaseException) and cause.full_key:
        reason = _first_line(cause).rstrip(".")
        if reason.startswith("Incompatible value 'None'"):
            return CommandError(f"{cause.full_key}=: needs a value{_example(str(cause.full_key), known)}")
        if "is not a subclass of" in reason:
            return CommandError(f"{cause.full_key}: this is a group of settings; set one of them, {cause.full_key}.…=…")
        return CommandError(
            f"{cause.full_key}: {reason[:1].lower() + reason[1:]}{_example(str(cause.full_key), known)}"
        )
    if isinstance(error, ConfigCompositionException) and "Ambiguous value" in str(error):
        return CommandError(
            f"{_first_line(error).split(chr(39))[1]}: several values; add --multirun to train one run for each, "
            "or write a list as [a,b]"
        )
    return CommandError(_first_line(error))


def unreadable(word: str | None) -> CommandError:
    """A word whose value cannot be parsed."""
    return CommandError(f"{word}: this is not name=value; quote a value that holds signs: name='va,l=ue'")


def wrong_name(name: str, names: list[str]) -> CommandError:
    """A setting that there is not, with the near ones."""
    return CommandError(f"{name}: there is no such setting; {near_names(name, names)}")


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0]


def setting_names(config: Any, prefix: str = "") -> list[str]:
    """Dotted names of all settings of a configuration."""
    if not isinstance(config, DictConfig):
        return [prefix]
    names = []
    for key in config:
        dotted = f"{prefix}.{key}" if prefix else str(key)
        names += setting_names(config._get_node(key), dotted)
    return names


def _near_keys(wrong: str, known: DictConfig | None) -> str:
    """What may be meant: the same last word under another group, else a near name in the same group."""
    names = setting_names(known) if known is not None else []
    group, _, last = wrong.rpartition(".")
    elsewhere = [name for name in names if name.split(".")[-1] == last]
    if elsewhere:
        return f"did you mean {' or '.join(elsewhere[:3])}?"
    prefix = f"{group}." if group else ""
    beside = {name[len(prefix) :].split(".")[0] for name in names if name.startswith(prefix)}
    return near_names(last, sorted(beside or {name.split(".")[0] for name in names}))


def _example(key: str, known: DictConfig | None) -> str:
    """What would be right, from the value that stands there by default."""
    default = OmegaConf.select(known, re.sub(r"\[\d+\]$", "", key)) if known is not None else None
    if default is None:
        return ""
    if isinstance(default, ListConfig):
        return f"; it takes a list such as [{','.join(str(item) for item in default) or 'a,b'}]"
    kind = _KINDS.get(type(default))
    shown = str(default).lower() if isinstance(default, bool) else default
    return f"; it takes {kind}, such as {shown}" if kind else ""
