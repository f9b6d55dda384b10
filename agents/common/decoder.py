"""What the action of a high-level policy means to the low-level agent beneath it."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor
from torch.nn import functional as F


@dataclass(frozen=True)
class Command:
    """What a low-level agent is told for the length of a decision.

    Attributes:
        latent: `[N, Z]` of unit length.
        observed: observations `[N, ...]` that it sees in place of the environment's own, such as a chosen "skill".
    """

    latent: Tensor
    observed: dict[str, Tensor] = field(default_factory=dict)


class Decoder(Protocol):
    """Turns actions into commands."""

    @property
    def space(self) -> spaces.Box:
        """The actions of one world, `[A]`."""
        ...

    def __call__(self, action: Tensor) -> Command:
        """The commands that actions `[N, A]` stand for."""
        ...


class SphereDecoder:
    """The action is the latent before its projection onto the sphere (ASE, section 7.1).

    Close to the origin a Gaussian's projection is uniform, far from it nearly a point: the policy's mean decides how
    much it explores.
    """

    def __init__(self, latent_dim: int) -> None:
        self.space = spaces.Box(-np.inf, np.inf, (latent_dim,), np.float32)

    def __call__(self, action: Tensor) -> Command:
        return Command(to_sphere(action))


def to_sphere(z: Tensor) -> Tensor:
    """Latents `[..., Z]` of unit length in the directions of `z`; the first axis where that is next to nothing.

    The mean action of an untrained policy is zero, and no low-level policy has ever met a latent of that length.
    """
    first_axis = torch.zeros_like(z)
    first_axis[..., 0] = 1
    return F.normalize(torch.where(z.norm(dim=-1, keepdim=True) > 1e-9, z, first_axis), dim=-1)
