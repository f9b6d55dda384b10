"""Labels that a small network learns from labelled clips and gives to others, as C·ASE does for raw recordings (A.2.1).

There a skeleton-based action recogniser is fine-tuned; here a perceptron sees short windows of the state, and the
windows of a clip vote.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from murmillo.envs.character import Character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.labels.features import clip_states


@dataclass(frozen=True)
class ClassifierConfig:
    """The network and how it learns; split, batch, epochs and optimiser are the paper's.

    Attributes:
        held_out: share of the clips that accuracy is measured on.
        window: frames that the network sees at once, `stride` apart [control steps].
        hop: control steps from one window of a clip to the next.
        rate: of SGD with momentum 0.9, annealed to 0 along a cosine.
    """

    held_out: float = 0.1
    window: int = 10
    stride: int = 2
    hop: int = 5
    hidden: tuple[int, ...] = (128,)
    dropout: float = 0.3
    epochs: int = 80
    batch: int = 128
    rate: float = 0.1
    momentum: float = 0.9
    weight_decay: float = 5e-4
    seed: int = 0


@dataclass(frozen=True)
class HeldOut:
    """How the network did on the clips that it was not trained on.

    Attributes:
        clips: held out, of a label that others had too.
        correct: of them, how many got their own label.
        commonest: how many would get theirs if every clip got the commonest label.
        trained: clips that it learned from.
    """

    clips: int
    correct: int
    commonest: int
    trained: int

    @property
    def accuracy(self) -> float:
        """Share of the held-out clips that got their own label."""
        return self.correct / self.clips


def classify(
    clips: Sequence[Clip], labelled: Sequence[Clip], character: Character, config: ClassifierConfig | None = None
) -> tuple[list[Clip], HeldOut]:
    """The clips with labels learned from labelled ones, and the accuracy of the very network that gave them.

    Clips are held out whole: windows of one clip are too alike to be on both sides.

    Raises:
        MotionError: fewer than two labels, or no label that two clips share.
    """
    config = config or ClassifierConfig()
    labels = sorted({clip.label for clip in labelled})
    if len(labels) < 2:
        raise MotionError(f"a classifier needs clips of at least two labels; these have {labels[0]!a} alone")
    held = _held_out(labelled, config)
    states = clip_states([*labelled, *clips], character)
    windows = [_windows(state, config) for state in states]
    known, unknown = windows[: len(labelled)], windows[len(labelled) :]
    target = [labels.index(clip.label) for clip in labelled]
    trained = [i for i in range(len(labelled)) if i not in held]
    network = _train([known[i] for i in trained], [target[i] for i in trained], len(labels), config)
    correct = sum(_vote(network, known[i]) == target[i] for i in held)
    (commonest, _), *_ = Counter(target[i] for i in trained).most_common(1)
    counts = HeldOut(len(held), correct, sum(target[i] == commonest for i in held), len(trained))
    return [replace(clip, label=labels[_vote(network, own)]) for clip, own in zip(clips, unknown, strict=True)], counts


def _held_out(labelled: Sequence[Clip], config: ClassifierConfig) -> list[int]:
    """Clips drawn at random to be held out, such that each label keeps one to learn from."""
    left = Counter(clip.label for clip in labelled)
    order = torch.randperm(len(labelled), generator=torch.Generator().manual_seed(config.seed)).tolist()
    wanted = max(1, round(config.held_out * len(labelled)))
    held: list[int] = []
    for i in order:
        if len(held) < wanted and left[labelled[i].label] > 1:
            left[labelled[i].label] -= 1
            held.append(i)
    if not held:
        raise MotionError(
            "a classifier needs a label that two clips share, to hold one out; give clips that share labels"
        )
    return held


def _windows(state: Tensor, config: ClassifierConfig) -> Tensor:
    """Windows [W, window * 120] of the states [F, 120]; a short clip's last frame is repeated."""
    span = (config.window - 1) * config.stride + 1
    if len(state) < span:
        state = torch.cat((state, state[-1:].expand(span - len(state), -1)))
    return state.unfold(0, span, config.hop)[..., :: config.stride].transpose(1, 2).flatten(1)


def _train(windows: list[Tensor], targets: list[int], labels: int, config: ClassifierConfig) -> nn.Module:
    """A perceptron that has learned the label of each window; each label weighs the same."""
    x = torch.cat(windows)
    y = torch.cat([torch.full((len(own),), target) for own, target in zip(windows, targets, strict=True)])
    scale, weight = _Scale(x), _balance(y, labels)
    with torch.random.fork_rng(devices=[]):  # layers and dropout draw from torch's own generator
        torch.manual_seed(config.seed)
        network = _network(x.shape[1], labels, config)
        optimiser = torch.optim.SGD(
            network.parameters(), config.rate, momentum=config.momentum, weight_decay=config.weight_decay
        )
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.epochs)
        scaled = scale(x)
        for _ in range(config.epochs):
            for batch in torch.randperm(len(x)).split(config.batch):
                loss = F.cross_entropy(network(scaled[batch]), y[batch], weight=weight)
                optimiser.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(network.parameters(), 1.0)
                optimiser.step()
            schedule.step()
    return nn.Sequential(scale, network).eval()


def _balance(y: Tensor, labels: int) -> Tensor:
    counts = torch.bincount(y, minlength=labels).clamp_min(1)
    return len(y) / (labels * counts)


def _network(width: int, labels: int, config: ClassifierConfig) -> nn.Sequential:
    layers: list[nn.Module] = []
    for hidden in config.hidden:
        layers += [nn.Linear(width, hidden), nn.ReLU(), nn.Dropout(config.dropout)]
        width = hidden
    return nn.Sequential(*layers, nn.Linear(width, labels))


class _Scale(nn.Module):
    """Standardises features by the moments of those that were learned from [W, D]; one that does not vary becomes 0."""

    def __init__(self, x: Tensor) -> None:
        super().__init__()
        spread = x.std(0, correction=0)
        self.mean, self.spread = x.mean(0), torch.where(spread > 1e-6, spread, torch.inf)

    def forward(self, x: Tensor) -> Tensor:
        return (x - self.mean) / self.spread


@torch.no_grad()
def _vote(network: nn.Module, windows: Tensor) -> int:
    """The label to which the windows [W, D] of one clip give the highest mean log-probability."""
    return int(F.log_softmax(network(windows), dim=-1).mean(0).argmax())
