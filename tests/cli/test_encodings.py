"""The encodings that the report judges: of windows that slide over each clip, without what the clip leaves out."""

from types import SimpleNamespace

import pytest
import torch
from torch import Tensor

from murmillo.cli.encodings import concentration


class Library:
    """Two clips of 2 and 3 s; a window of clip c that ends at t is [c, t]."""

    mask: Tensor | None = None

    def __init__(self, duration: tuple[float, ...] = (2.0, 3.0)) -> None:
        self.duration = torch.tensor(duration, dtype=torch.float64)

    def window(self, clip: Tensor, time: Tensor, frames: int) -> Tensor:
        assert frames == 31
        return torch.stack([clip.double(), time], dim=1)


class Agent:
    encoder = SimpleNamespace(frames=31)

    def __init__(self) -> None:
        self.seen: list[Tensor] = []
        self.masks: list[Tensor | None] = []

    def encode(self, window: Tensor, mask: Tensor | None = None) -> Tensor:
        self.seen.append(window)
        self.masks.append(mask)
        return window


def env(library: Library) -> SimpleNamespace:
    return SimpleNamespace(library=library, character=SimpleNamespace(control_dt=1 / 30))


def test_windows_slide_over_every_clip_from_its_first_whole_one() -> None:
    agent = Agent()
    assert concentration(env(Library()), agent) is not None  # type: ignore[arg-type]
    first, second = agent.seen
    assert first[:, 0].tolist() == [0.0] * 6
    assert first[:, 1].tolist() == pytest.approx([1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
    assert (len(second), second[-1, 1].item()) == (11, pytest.approx(3.0))


def test_what_a_clip_leaves_out_is_left_out_of_its_encodings() -> None:
    agent, library = Agent(), Library()
    library.mask = torch.tensor([[False], [True]])
    concentration(env(library), agent)  # type: ignore[arg-type]
    first, second = agent.masks
    assert first is not None
    assert second is not None
    assert (first.tolist(), second.tolist()) == ([[False]] * 6, [[True]] * 11)


def test_clips_too_short_for_two_windows_say_nothing() -> None:
    assert concentration(env(Library((0.5, 1.0))), Agent()) is None  # type: ignore[arg-type]


def test_an_agent_without_encoder_has_none() -> None:
    assert concentration(env(Library()), SimpleNamespace()) is None  # type: ignore[arg-type]
