"""On what a run learns, and on what everybody else looks at it."""

import dataclasses

import torch

from murmillo.envs import EnvConfig
from murmillo.envs.tracking import TrackingConfig

CPU = torch.device("cpu")


def for_training(env: EnvConfig) -> EnvConfig:
    """The environment's settings with tensors in place of arrays, which then need not leave the device."""
    return dataclasses.replace(env, tensors=True)


def for_playing(env: EnvConfig) -> EnvConfig:
    """Those of all commands but training: MuJoCo on the CPU, so that any machine plays what another has trained.

    Nobody has a clip to follow there, nor loses it.
    """
    here = {"physics": "cpu", "device": "auto", "tensors": False, "contacts": 0, "constraints": 0}
    return dataclasses.replace(env, **here, tracking=TrackingConfig())
