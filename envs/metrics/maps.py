"""Flat maps of points in many dimensions, to be looked at."""

import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError


def classical_mds(distance: Tensor) -> Tensor:
    """Classical multidimensional scaling: points in the plane whose distances are near to these (Torgerson 1952).

    With B = -1/2 J D^2 J, where J = I - 1/n centres and D^2 holds the squared distances, the coordinates are B's two
    leading eigenvectors, each times the root of its eigenvalue. AdaptNet's figure 17 is such a map of its latents: give
    `torch.cdist(latent, latent)` of a few thousand at most, for the eigenvectors take n^3 steps; or `class_distances`.

    Args:
        distance: [n, n], symmetric; its diagonal counts as 0.

    Returns:
        [n, 2] in the distances' unit, centred; the widest axis first, the sign such that an axis's largest is positive.
    """
    squared = distance.double().square().fill_diagonal_(0.0)
    centred = squared - squared.mean(0) - squared.mean(1, keepdim=True) + squared.mean()
    value, vector = torch.linalg.eigh(-0.5 * centred)
    point = (vector * value.clamp_min(0.0).sqrt())[:, -2:].flip(1)
    largest = point.gather(0, point.abs().argmax(0, keepdim=True))
    return point * torch.where(largest < 0, -1.0, 1.0)


def tsne(points: Tensor, seed: int, perplexity: float = 30.0) -> Tensor:
    """t-SNE: neighbours stay neighbours, distances further away mean nothing (van der Maaten and Hinton 2008).

    CALM's figure 10 is such a map of its encodings. By scikit-learn, from the principal components.

    Args:
        points: [n, Z].
        seed: equal seeds give equal maps.
        perplexity: about how many neighbours a point has; lowered to (n - 1) / 3 for few points.

    Returns:
        [n, 2] float32, of no unit.

    Raises:
        SuiteError: scikit-learn is not installed.
    """
    try:
        from sklearn.manifold import TSNE
    except ImportError:
        raise SuiteError("t-SNE needs scikit-learn; install it with: pip install murmillo[metrics]") from None
    embedding = TSNE(perplexity=min(perplexity, (len(points) - 1) / 3), init="pca", random_state=seed)
    return torch.from_numpy(embedding.fit_transform(points.detach().cpu().double().numpy()))
