"""Where tensors live: the physics decides, and everything around it follows.

Code of the suite names no device. What it makes anew is made where `at_home` says, and constants that outlive a call
are `Placed`, so that nothing is copied from the host in every step.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import wraps
from typing import Concatenate, ParamSpec, Protocol, TypeVar

import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError

P = ParamSpec("P")
R = TypeVar("R")


class _Homed(Protocol):
    @property
    def home(self) -> torch.device: ...


H = TypeVar("H", bound=_Homed)


def at_home(method: Callable[Concatenate[H, P], R]) -> Callable[Concatenate[H, P], R]:
    """A method in which new tensors are made on the device `self.home`, whatever torch's default is outside."""

    @wraps(method)
    def placed(self: H, *args: P.args, **kwargs: P.kwargs) -> R:
        with on(self.home):
            return method(self, *args, **kwargs)

    return placed


def on(device: torch.device) -> AbstractContextManager:
    """A context in which new tensors are made on this device; it costs nothing where they are anyway."""
    return nullcontext() if torch.get_default_device() == device else device


def find_device(name: str) -> torch.device:
    """The torch device of this name; "auto" is the CPU.

    Raises:
        SuiteError: there is no such device.
    """
    try:
        device = torch.device("cpu" if name == "auto" else name)
        return torch.empty(0, device=device).device
    except (RuntimeError, AssertionError) as error:
        gpus = [f"cuda:{i}" for i in range(torch.cuda.device_count())]
        raise SuiteError(f"device={name}: no such device; there are: auto, {', '.join(['cpu', *gpus])}") from error


class Placed:
    """A constant that is at hand wherever it has been asked for once."""

    def __init__(self, constant: Tensor) -> None:
        self._copies = {(constant.device, constant.dtype): constant}
        self._constant = constant

    def like(self, tensor: Tensor) -> Tensor:
        """The constant on the device and in the dtype of the tensor."""
        key = (tensor.device, tensor.dtype)
        if key not in self._copies:
            self._copies[key] = self._constant.to(tensor)
        return self._copies[key]

    def on(self, device: torch.device) -> Tensor:
        """The constant on the device, in its own dtype."""
        key = (device, self._constant.dtype)
        if key not in self._copies:
            self._copies[key] = self._constant.to(device)
        return self._copies[key]
