"""The motion encoder z = E(M) (CALM, section 5.1.1)."""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from murmillo.agents.calm.config import EncoderConfig
from murmillo.agents.common.discriminator import Windows, leave_out
from murmillo.agents.common.networks import linear, mlp
from murmillo.agents.common.normalizer import RunningNormalizer


class MotionEncoder(nn.Module):
    """Motions of F frames to latents on the unit sphere."""

    def __init__(self, state_dim: int, latent_dim: int, config: EncoderConfig, generator: torch.Generator) -> None:
        super().__init__()
        # the network sees frames F-1, F-1-stride, ...
        self.register_buffer("_seen", torch.arange(config.frames - 1, -1, -config.stride).flip(0), persistent=False)
        self.frames = config.frames
        # one normaliser for all frames, as the discriminator's
        self.normalizer = RunningNormalizer((state_dim,))
        self.trunk = mlp([len(self._seen) * state_dim, *config.hidden], generator)
        self.head = linear(config.hidden[-1], latent_dim, generator, bound=0.1)

    _seen: Tensor

    def forward(self, motion: Windows) -> Tensor:
        """Latents `[B, Z]` of unit length from raw motions `[B, F, D]`, oldest frame first."""
        x = leave_out(self.normalizer(motion.window[:, self._seen]), motion.mask)
        return F.normalize(self.head(self.trunk(x.flatten(1))), dim=-1)
