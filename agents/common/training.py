"""What every update needs: Adam with a state that fits into a checkpoint, checked weights, means to log."""

from collections.abc import Iterable, Mapping
from typing import Any

import torch
from torch import Tensor, nn

from murmillo.agents.common.errors import AgentError


def adam(*groups: tuple[Iterable[nn.Parameter], float]) -> torch.optim.Adam:
    """One Adam over (parameters, learning rate) groups, each stepping as if it had its own."""
    return torch.optim.Adam([{"params": list(params), "lr": rate} for params, rate in groups], fused=True)


def adam_state(optimizer: torch.optim.Adam) -> dict[str, Any]:
    """Moments and step counts by parameter number; the learning rates are the config's."""
    return {str(number): dict(moments) for number, moments in optimizer.state_dict()["state"].items()}


def load_adam_state(optimizer: torch.optim.Adam, state: Mapping[str, Any]) -> None:
    moments = {int(number): dict(values) for number, values in state.items()}
    optimizer.load_state_dict({"state": moments, "param_groups": optimizer.state_dict()["param_groups"]})


def load_module(module: nn.Module, state: Mapping[str, Tensor], name: str) -> None:
    """Load the weights of `module`; an AgentError in one line where they are another network's."""
    own = module.state_dict()
    if own.keys() != state.keys():
        parts = sorted(own.keys() ^ state.keys())
        raise AgentError(f"the checkpoint's {name} has other layers than the config's, among them '{parts[0]}'")
    for key, value in own.items():
        if value.shape != state[key].shape:
            raise AgentError(
                f"the checkpoint's {name} differs from the config's: '{key}' is {list(state[key].shape)} there, "
                f"{list(value.shape)} here"
            )
    module.load_state_dict(state)


class Means:
    """Collects named scalars; `result` gives the mean of each."""

    def __init__(self) -> None:
        self._values: dict[str, list[Tensor]] = {}

    def add(self, scalars: Mapping[str, Tensor]) -> None:
        for name, value in scalars.items():
            self._values.setdefault(name, []).append(value.detach())

    def result(self) -> dict[str, float]:
        return {name: torch.stack(values).mean().item() for name, values in self._values.items()}


def named(group: str, scalars: Mapping[str, float]) -> dict[str, float]:
    """The same scalars under "group/name"."""
    return {f"{group}/{name}": value for name, value in scalars.items()}
