"""What all metrics of an evaluation share: the clips, what they are compared by, and who is judged."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from murmillo.cli.evaluation.digests import Digest
from murmillo.cli.evaluation.protocols import HELD, WINDOW
from murmillo.cli.evaluation.replay import clip_states
from murmillo.envs.character import CONTROL_DT, Character
from murmillo.envs.metrics.classifier import Classifier, ClassifierConfig, train_classifier
from murmillo.envs.metrics.coverage import positions
from murmillo.envs.metrics.nearest import ClipMatcher
from murmillo.envs.motion import MotionLibrary
from murmillo.envs.observations import state_parts


class Scene:
    """The clips of an evaluation and the seed of its draws."""

    def __init__(self, character: Character, library: MotionLibrary, seed: int, labelled: bool) -> None:
        """`labelled`: the run's agent is told a label, and not a motion."""
        self.character, self.library, self.seed, self.labelled = character, library, seed, labelled
        self.states = clip_states(library)
        """[F_c, D] of each clip, a frame a control step."""
        self.matcher = ClipMatcher(self.states)
        self.distinct = self.matcher.distinct

    def generator(self) -> torch.Generator:
        """A new one, of the evaluation's seed."""
        return torch.Generator().manual_seed(self.seed)

    @property
    def names(self) -> list[str]:
        """[K] of the distinct clips."""
        return [self.library.clips[clip].name for clip in self.distinct]

    @cached_property
    def first_alike(self) -> Tensor:
        """[C] int64: of each clip the first that has the very same states."""
        first: dict[tuple, int] = {}
        alike = [first.setdefault((len(s), s.numpy().tobytes()), clip) for clip, s in enumerate(self.states)]
        return torch.tensor(alike)

    @property
    def duplicates(self) -> list[list[str]]:
        """Names of the clips that are bit for bit the same, a list a group."""
        groups = [(self.first_alike == clip).nonzero().flatten().tolist() for clip in self.distinct]
        return [[self.library.clips[clip].name for clip in group] for group in groups if len(group) > 1]

    def reference_windows(self, n: int) -> Tensor:
        """[n, WINDOW, D] windows of random clips, by their weights, at random times."""
        clip, time = self.library.sample(n, self.generator(), span=(WINDOW - 1) * CONTROL_DT)
        return self.library.window(clip, time, WINDOW)

    def number(self, clip: Tensor) -> Tensor:
        """[n] places among the distinct clips of clips [n]."""
        return positions(self.first_alike[clip], self.distinct)

    @cached_property
    def classifier(self) -> Classifier:
        """Trained on the distinct clips, and on their poses held still as a last class."""
        clips = [self.states[clip] for clip in self.distinct]
        parts = state_parts(self.character)
        velocities = torch.zeros(clips[0].shape[1], dtype=torch.bool)
        for part in (parts.linear, parts.angular, parts.joint_velocities):
            velocities[part] = True
        config = ClassifierConfig(frames=self._seen_at_once)
        return train_classifier(clips, self.generator(), config=config, velocities=velocities)

    def probabilities(self, window: Tensor) -> Tensor:
        """[n, K + 1] of the distinct clips and of a held pose, from the first frames of windows [n, WINDOW, D]."""
        return self.classifier.probabilities(window[:, : self._seen_at_once])

    @property
    def _seen_at_once(self) -> int:
        """Frames of the classifier's windows, of which every clip has one."""
        return min(ClassifierConfig.frames, WINDOW, *map(len, self.states))


@dataclass(frozen=True)
class Evidence:
    """What one source has left behind, for the metrics to judge.

    Attributes:
        scene: the clips.
        source: its name.
        agent: the policy's agent; None for clips that are replayed.
        digests: by the protocol's name; of those that were recorded.
    """

    scene: Scene
    source: str
    agent: Any
    digests: dict[str, Digest]

    @property
    def held(self) -> Digest:
        return self.digests[HELD.name]
