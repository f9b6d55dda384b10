"""Numbers among the settings, refused where they cannot be."""

from typing import Any

from murmillo.agents.common.errors import AgentError


def check_at_least(least: float, config: Any, place: str, *names: str) -> None:
    """Refuse settings of a configuration below `least`, and NaN; None is allowed.

    Args:
        least: that they may be.
        config: which has them.
        place: of the configuration on the command line, such as "agent.ppo".
        names: of the settings.

    Raises:
        AgentError: naming the setting.
    """
    for name in names:
        if (value := getattr(config, name)) is not None and not value >= least:  # so written, a NaN is refused too
            raise AgentError(f"{place}.{name}={value}: needs at least {least:g}")


def check_above_zero(config: Any, place: str, *names: str) -> None:
    """The same of settings that must be more than 0."""
    for name in names:
        if (value := getattr(config, name)) is not None and not value > 0:
            raise AgentError(f"{place}.{name}={value}: needs a number above 0")
