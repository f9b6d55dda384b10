"""Skill discovery as pure functions: ASE's encoder (eqs. 12, 13), skill reward (eq. 10) and diversity (eq. 15).

Everywhere `mu_q` `[..., Z]` is the encoder's mean and `z` `[..., Z]` the latent, both of unit length.
"""

from torch import Tensor


def encoder_loss(mu_q: Tensor, z: Tensor, kappa: float) -> Tensor:
    """-E kappa mu_q . z: minus the von Mises-Fisher log likelihood without its constant (eq. 13)."""
    return -kappa * (mu_q * z).sum(-1).mean()


def skill_reward(mu_q: Tensor, z: Tensor, kappa: float, form: str) -> Tensor:
    """Reward `[...]` for behaving so that the encoder recovers the latent.

    Args:
        mu_q: the encoder's mean.
        z: the latent that acted.
        kappa: concentration.
        form: "log_q", the paper's log q(z | s, s') = kappa mu_q . z up to a constant, or "clamped", the released code's
            max(mu_q . z, 0), which never makes an early end of the episode attractive.
    """
    log_q = kappa * (mu_q * z).sum(-1)
    return log_q.clamp(min=0) if form == "clamped" else log_q


def diversity_loss(mean: Tensor, other_mean: Tensor, z: Tensor, other_z: Tensor, std: Tensor, form: str) -> Tensor:
    """E (D_action / D_z - 1)^2 with D_z = (1 - z . z') / 2 (last term of eq. 15).

    Args:
        mean: mean action `[B, A]` under z.
        other_mean: mean action `[B, A]` of the same state under z'.
        z: `[B, Z]`.
        other_z: `[B, Z]`.
        std: the policy's standard deviation `[A]`.
        form: D_action is "kl", the paper's KL divergence of the two Gaussians, sum_j (mu_j - mu'_j)^2 / (2 std_j^2), or
            "action", the released code's mean_j (clip mu_j - clip mu'_j)^2.
    """
    if form == "kl":
        distance = 0.5 * ((mean - other_mean) / std).square().sum(-1)
    else:
        distance = (mean.clamp(-1, 1) - other_mean.clamp(-1, 1)).square().mean(-1)
    latent_distance = 0.5 - 0.5 * (z * other_z).sum(-1)
    return (distance / (latent_distance + 1e-5) - 1).square().mean()
