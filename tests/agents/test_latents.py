import pytest
import torch

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.latents import LatentSequence, sample_sphere


def test_the_sphere_is_covered_evenly(generator: torch.Generator) -> None:
    z = sample_sphere(40_000, 3, generator)
    torch.testing.assert_close(z.norm(dim=1), torch.ones(40_000))
    assert z.mean(0).abs().max() < 0.01
    # E z z^T = I / 3, and each of the 8 orthants has an eighth
    torch.testing.assert_close(z.T @ z / len(z), torch.eye(3) / 3, atol=0.01, rtol=0)
    orthant = (z > 0).long() @ torch.tensor([1, 2, 4])
    assert (orthant.bincount(minlength=8) / len(z) - 1 / 8).abs().max() < 0.01
    # on a sphere in three dimensions each coordinate is uniform
    assert z[:, 0].abs().mean().item() == pytest.approx(0.5, abs=0.01)


def test_latents_last_between_the_two_bounds_and_all_durations_occur(generator: torch.Generator) -> None:
    sequence = LatentSequence(200, 4, generator, min_steps=2, max_steps=5)
    history = torch.stack([sequence.step() for _ in range(100)])
    durations = set()
    for world in range(200):
        switches = (history[1:, world] != history[:-1, world]).any(-1).nonzero().flatten()
        durations |= set(switches.diff().tolist())
    assert durations == {2, 3, 4, 5}


def test_reset_changes_only_the_named_worlds(generator: torch.Generator) -> None:
    sequence = LatentSequence(5, 4, generator, min_steps=50, max_steps=50)
    before = sequence.step()
    sequence.reset(torch.tensor([1, 3]))
    after = sequence.step()
    assert (before != after).any(-1).tolist() == [False, True, False, True, False]
    torch.testing.assert_close(after.norm(dim=1), torch.ones(5))


def test_returned_latents_are_not_overwritten_later(generator: torch.Generator) -> None:
    sequence = LatentSequence(3, 4, generator, min_steps=1, max_steps=1)
    first = sequence.step()
    copy = first.clone()
    sequence.step()
    assert torch.equal(first, copy)


def test_latents_of_another_number_of_worlds_are_refused(generator: torch.Generator) -> None:
    state = LatentSequence(3, 4, generator).state_dict()
    with pytest.raises(AgentError, match=r"\[3, 4\], the run's \[5, 4\]"):
        LatentSequence(5, 4, generator).load_state_dict(state)


def test_impossible_durations_are_refused(generator: torch.Generator) -> None:
    with pytest.raises(AgentError, match="latent_steps"):
        LatentSequence(1, 4, generator, min_steps=0)
