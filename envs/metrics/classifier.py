"""What a classifier of the clips sees in what a policy does.

It is a small network from a window of states to the clip it is from, trained on the clips alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from murmillo.envs.errors import SuiteError
from murmillo.envs.metrics.windows import windows

_AT_ONCE = 4096
"""Windows, so that long libraries fit into memory."""


@dataclass(frozen=True)
class ClassifierConfig:
    """The network and how it learns; CALM says of its own only that it maps a motion to its clip.

    Attributes:
        frames: that the network sees at once [control steps].
        held_out: share of a clip that accuracy is measured on.
        jitter: what is added to a window that trains, of each feature's deviation and the same in all frames: a
            character is never quite where its clip is, and one that stands has nothing else to be known by.
        held: a window that differs by more from the pose in its middle, in mean squared deviations of its features, is
            a motion; that pose, held still, is none.
        stand: where such a pose is as near as this to one of a clip that stands, by the same measure, it is that stand.
        steps: of Adam, each on a batch in which every class is as likely.
        rate: of Adam, annealed to 0 along a cosine.
    """

    frames: int = 15
    held_out: float = 0.1
    jitter: float = 0.3
    held: float = 0.15
    stand: float = 0.3
    hidden: int = 256
    dropout: float = 0.3
    steps: int = 800
    batch: int = 256
    rate: float = 1e-3
    weight_decay: float = 1e-2


@dataclass(frozen=True)
class Classifier:
    """A network that was trained on all windows, and how one like it did that was not shown some of them.

    Attributes:
        network: [n, F, D] states to [n, K] logits, or [n, K + 1] where a pose of a motion that is held is a class.
        classes: K.
        held_out_windows: how many there were.
        held_out_accuracy: mean over the classes that had any of the share seen as what they are; 1 / K by chance.
    """

    network: nn.Module
    classes: int
    held_out_windows: int
    held_out_accuracy: float

    def probabilities(self, window: Tensor) -> Tensor:
        """p(class | window) [n, K] or [n, K + 1] of windows [n, F, D] of states; the last may be a held pose."""
        return _probabilities(self.network, window)


def train_classifier(
    clips: Sequence[Tensor],
    generator: torch.Generator,
    label: Tensor | None = None,
    config: ClassifierConfig | None = None,
    velocities: Tensor | None = None,
) -> Classifier:
    """Learn to tell the clips from short windows of them.

    For the accuracy a stretch of each clip is held out, and no window that touches it is trained on: neighbouring
    windows share nearly all their frames, so that random ones held out would measure memory. See `held_out_split`. The
    classifier that is returned learned in the same way from all windows: a stretch of a strike is the strike itself.

    Args:
        clips: [F_c, D] states of each, a frame a control step; bit-identical clips should be given once.
        generator: decides the stretches, the initial weights and the order of training; nothing else does.
        label: [C] int64, the class of each clip; by default every clip is one.
        velocities: [D] bool, which features are; told that, it learns a class of its own for poses that are held where
            the clips move. Without it who freezes in the pose of a run is seen as running.

    Raises:
        SuiteError: a clip shorter than a window, or none long enough to hold anything out.
    """
    config = config or ClassifierConfig()
    label = torch.arange(len(clips)) if label is None else label
    rates = torch.zeros(clips[0].shape[1:], dtype=torch.bool) if velocities is None else velocities
    classes = int(label.max()) + 1
    everything, trained, tested = [], [], []
    for number, (clip, own) in enumerate(zip(clips, label.tolist(), strict=True)):
        if len(clip) < config.frames:
            raise SuiteError(
                f"clip {number} has {len(clip)} frames, a window of the classifier {config.frames}; "
                "ask for shorter windows or leave the clip out"
            )
        every = windows([clip], config.frames)
        train, held = held_out_split(len(clip), config.frames, config.held_out, generator)
        everything.append((every, own))
        trained.append((every[train], own))
        tested.append((every[held], own))
    held_window, held_target = _gather(tested)
    if not len(held_target):
        raise SuiteError(
            f"windows of {config.frames} frames: no clip has room to hold one out; ask for shorter windows"
        )
    seeds = torch.randint(2**62, (2,), generator=generator).tolist()
    judged, network = (
        _train(*_gather(part), rates, classes, config, seed)
        for part, seed in zip((trained, everything), seeds, strict=True)
    )
    accuracy = _balanced_accuracy(_probabilities(judged, held_window), held_target)
    return Classifier(network, classes, len(held_target), accuracy)


def inception_score(probability: Tensor) -> float:
    """How sure the classifier is of each motion, and how many different things it sees (Salimans et al. 2016).

        exp( E_x KL( p(y|x) || p(y) ) )  with  p(y) = E_x p(y|x)

    Up is good: 1 where all motions look alike, K where all K clips are seen equally often and surely. CALM reports 19.8
    for itself and 18.6 for ASE, on 160 clips and with a classifier of its own: compare scores of one classifier only.

    Args:
        probability: [n, K] of windows of motion from random latents, or with what is no class, [n, K + 1].
    """
    p = probability.double()
    divergence = torch.xlogy(p, p) - torch.xlogy(p, p.mean(0))
    return divergence.sum(1).mean().exp().item()


def controllability(probability: Tensor, commanded: Tensor) -> float:
    """Share of the windows that the classifier sees as what was commanded; up is good.

    It stands in for CALM's human raters, who found 78 % of its motions to be like the requested one and 35 % of ASE's
    (section 8.1), and is no more than that. 1 / K is chance; the clips' own windows give the most that can be expected.

    Args:
        probability: [n, K], or with what is no class, [n, K + 1].
        commanded: [n] int64, the class of the clip or label that each window should show.
    """
    return (probability.argmax(1) == commanded).double().mean().item()


def confusion(probability: Tensor, commanded: Tensor, classes: int) -> Tensor:
    """What the windows under each command are seen as: shares [classes, K], or [classes, K + 1], float64.

    Its diagonal says which commands are obeyed. A row whose command no window has is 0.

    Args:
        probability: [n, K], or with what is no class, [n, K + 1].
        commanded: [n] int64, as for `controllability`.
        classes: how many commands there are.
    """
    seen = F.one_hot(probability.argmax(1), probability.shape[1]).double()
    counts = seen.new_zeros(classes, probability.shape[1]).index_add_(0, commanded, seen)
    return counts / counts.sum(1, keepdim=True).clamp_min(1.0)


def held_out_split(length: int, frames: int, share: float, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Which windows of a clip train and which are held out, so that none of the one shares a frame with the other.

    The held-out windows are those inside a stretch of `share` of the clip, a window at least, somewhere in it at
    random; those that train lie wholly before or after. A clip where no such stretch leaves a window to train holds out
    none.

    Returns:
        First frames of the windows of either kind, ascending.
    """
    start = torch.arange(length - frames + 1)
    stretch = max(frames, round(share * length))
    places = torch.arange(max(0, length - stretch + 1))
    places = places[(places >= frames) | (places + stretch + frames <= length)]
    if not len(places):
        return start, start[:0]
    first = places[torch.randint(len(places), (), generator=generator)]
    end = first + stretch
    inside = (start >= first) & (start + frames <= end)
    outside = (start + frames <= first) | (start >= end)
    return start[outside], start[inside]


def _gather(parts: list[tuple[Tensor, int]]) -> tuple[Tensor, Tensor]:
    """Windows [n, F, D] and their classes [n] of all clips."""
    target = [torch.full((len(window),), own) for window, own in parts]
    return torch.cat([window for window, _ in parts]), torch.cat(target)


def _train(
    window: Tensor, target: Tensor, rates: Tensor, classes: int, config: ClassifierConfig, seed: int
) -> nn.Module:
    """A perceptron that has learned the class of each window, and `classes` of poses held still if rates are known."""
    scale, outputs = _Scale(window), classes + bool(rates.any())
    if outputs > classes:
        still, seen_as = _held_poses(window, target, rates, scale, config)
        window, target = torch.cat((window, still)), torch.cat((target, seen_as))
    balanced = 1.0 / target.bincount()[target]
    with torch.random.fork_rng(devices=[]):  # layers and dropout draw from torch's own generator
        torch.manual_seed(seed)
        network = _network(scale, window[0].numel(), outputs, config)
        jitter = config.jitter * scale.deviation.masked_fill(rates, 0.0)
        optimiser = torch.optim.AdamW(network.parameters(), config.rate, weight_decay=config.weight_decay)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.steps)
        for _ in range(config.steps):
            batch = torch.multinomial(balanced, config.batch, replacement=True)
            moved = window[batch] + jitter * torch.randn(config.batch, 1, window.shape[-1])
            loss = F.cross_entropy(network(moved), target[batch])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    return network.eval()


def _held_poses(
    window: Tensor, target: Tensor, rates: Tensor, scale: "_Scale", config: ClassifierConfig
) -> tuple[Tensor, Tensor]:
    """Windows [m, F, D] of poses at rest, each the middle of a window of a motion, and the class that each is seen as.

    A class whose windows hardly move, most of them, is a stand. Held still, a pose is the stand that it is near, or
    none: the last class.
    """
    pose, classes = window[:, window.shape[1] // 2].masked_fill(rates, 0.0), int(target.max()) + 1
    moves = ((window - pose.unsqueeze(1)) / scale.deviation).square().mean((1, 2)) > config.held
    stands = moves.double().new_zeros(classes).index_add_(0, target, (~moves).double()) > 0.5 * target.bincount()
    own = ~moves & stands[target]
    seen_as = target.new_full((int(moves.sum()),), classes)
    if own.any():
        parts, stand = (pose[moves] / scale.deviation).split(_AT_ONCE), pose[own] / scale.deviation
        found = [torch.cdist(part, stand).min(1) for part in parts]
        apart, nearest = (torch.cat(column) for column in zip(*found, strict=True))
        near = apart.square() / pose.shape[1] <= config.stand
        seen_as = torch.where(near, target[own][nearest], seen_as)
    return pose[moves].unsqueeze(1).expand(-1, window.shape[1], -1), seen_as


def _network(scale: "_Scale", inputs: int, classes: int, config: ClassifierConfig) -> nn.Module:
    return nn.Sequential(
        scale,
        nn.Flatten(),
        nn.Dropout(config.dropout),
        nn.Linear(inputs, config.hidden),
        nn.ReLU(),
        nn.Dropout(config.dropout),
        nn.Linear(config.hidden, classes),
    )


class _Scale(nn.Module):
    """Brings each feature of windows [..., F, D] to mean 0 and deviation 1; one that never changes to 0."""

    mean: Tensor
    deviation: Tensor

    def __init__(self, window: Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", window.mean((0, 1)))
        self.register_buffer("deviation", window.std((0, 1)).clamp_min(1e-6))

    def forward(self, window: Tensor) -> Tensor:
        return (window - self.mean) / self.deviation


def _balanced_accuracy(probability: Tensor, target: Tensor) -> float:
    """Mean over the classes that occur of the share that is seen as what it is."""
    right = (probability.argmax(1) == target).double()
    return torch.stack([right[target == own].mean() for own in target.unique()]).mean().item()


def _probabilities(network: nn.Module, window: Tensor) -> Tensor:
    with torch.no_grad():
        return torch.cat([network(batch).softmax(-1) for batch in window.split(_AT_ONCE)])
