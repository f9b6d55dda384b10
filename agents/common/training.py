"""What every agent needs to learn and to be kept: Adam, states that fit into a checkpoint, means to log."""

from collections.abc import Iterable, Mapping
from typing import Any

import torch
from torch import Tensor, nn

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.ranks import ALONE, Ranks


def adam(*groups: tuple[Iterable[nn.Parameter], float]) -> torch.optim.Adam:
    """One Adam over (parameters, learning rate) groups, each stepping as if it had its own."""
    return torch.optim.Adam([{"params": list(params), "lr": rate} for params, rate in groups], fused=True)


def minimise(
    optimizer: torch.optim.Optimizer,
    losses: Mapping[str, Tensor],
    max_grad_norm: float | None = None,
    *,
    ranks: Ranks = ALONE,
) -> None:
    """One step down the sum of named losses, and its mean over the ranks.

    The gradient of all parameters together is scaled down to the norm.
    """
    optimizer.zero_grad()
    parameters = [p for group in optimizer.param_groups for p in group["params"]]
    # the inputs that a gradient penalty differentiates by need no gradient of the loss
    learning = [parameter for parameter in parameters if parameter.requires_grad]
    torch.stack(list(losses.values())).sum().backward(inputs=learning)
    ranks.average_gradients(parameters)
    if max_grad_norm is not None:
        nn.utils.clip_grad_norm_(parameters, max_grad_norm)
    optimizer.step()


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


def state_of(parts: Mapping[str, Any]) -> dict[str, Any]:
    """The states of an agent's parts by name: networks, optimisers, and what else has a `state_dict`."""
    return {
        name: adam_state(part) if isinstance(part, torch.optim.Adam) else part.state_dict()
        for name, part in parts.items()
    }


def load_parts(parts: Mapping[str, Any], state: Mapping[str, Any]) -> None:
    """Load what `state_of` gave; an AgentError in one line where it does not fit."""
    missing = sorted(parts.keys() - state.keys())
    if missing:
        raise AgentError(f"the checkpoint has no {', '.join(missing)}: it is another agent's or of another version")
    for name, part in parts.items():
        if isinstance(part, nn.Module):
            load_module(part, state[name], name)
        elif isinstance(part, torch.optim.Adam):
            load_adam_state(part, state[name])
        else:
            part.load_state_dict(state[name])


class Means:
    """Collects named scalars; `result` gives the mean of each, over the ranks too."""

    def __init__(self) -> None:
        self._values: dict[str, list[Tensor]] = {}

    def add(self, scalars: Mapping[str, Tensor]) -> None:
        for name, value in scalars.items():
            self._values.setdefault(name, []).append(value.detach())

    def result(self, ranks: Ranks = ALONE) -> dict[str, float]:
        return ranks.mean_scalars({name: torch.stack(values).mean().item() for name, values in self._values.items()})


def named(group: str, scalars: Mapping[str, float]) -> dict[str, float]:
    """The same scalars under "group/name"."""
    return {f"{group}/{name}": value for name, value in scalars.items()}
