"""The noise of actions: white or lasting, always standard normal, and gone on with where it was."""

import pytest
import torch

from murmillo.agents.common.exploration import QUIET_STEPS, ActionNoise

STEPS, WORLDS, DIM = 400, 200, 3


def drawn(correlation: float, steps: int = STEPS) -> torch.Tensor:
    noise = ActionNoise(torch.Generator().manual_seed(0), correlation)
    return torch.stack([noise.step(WORLDS, DIM) for _ in range(steps)])


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_it_is_standard_normal_at_every_step_and_correlated_as_asked(correlation: float) -> None:
    noise = drawn(correlation)
    assert noise.mean().abs() < 0.05
    # over the worlds of single steps too: the first is not smaller than the last
    torch.testing.assert_close(noise[[0, 1, 5, -1]].flatten(1).std(1), torch.ones(4), atol=0.1, rtol=0)
    for lag in (1, 2, 5):
        measured = (noise[lag:] * noise[:-lag]).mean()
        torch.testing.assert_close(measured, torch.tensor(correlation**lag), atol=0.02, rtol=0)


def test_white_noise_is_what_the_generator_gives() -> None:
    generator = torch.Generator().manual_seed(0)
    assert torch.equal(drawn(0.0, 5), torch.stack([torch.randn(WORLDS, DIM, generator=generator) for _ in range(5)]))


def test_worlds_and_axes_do_not_share_it() -> None:
    noise = drawn(0.9).permute(1, 2, 0).reshape(WORLDS * DIM, STEPS)
    among = torch.corrcoef(noise) - torch.eye(WORLDS * DIM)
    assert among.mean().abs() < 0.01


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_it_goes_on_where_it_was(correlation: float) -> None:
    at_once = drawn(correlation, 6)
    generator = torch.Generator().manual_seed(0)
    first = ActionNoise(generator, correlation)
    for _ in range(3):
        first.step(WORLDS, DIM)
    kept, state = first.state_dict(), generator.get_state()
    first.step(WORLDS, DIM)  # what is kept is not what goes on
    generator.set_state(state)
    again = ActionNoise(generator, correlation)
    again.load_state_dict(kept)
    for step in (3, 4, 5):
        assert torch.equal(again.step(WORLDS, DIM), at_once[step])


def test_noise_that_was_learned_with_begins_anew_in_other_worlds() -> None:
    learned = ActionNoise(torch.Generator().manual_seed(0), 0.9)
    learned.step(WORLDS, DIM)
    playing, fresh = (ActionNoise(torch.Generator().manual_seed(1), 0.9) for _ in range(2))
    playing.load_state_dict(learned.state_dict())
    assert torch.equal(playing.step(2, DIM), fresh.step(2, DIM))


@pytest.mark.parametrize("share", [0.25, 0.6])
def test_worlds_are_quiet_for_the_share_of_the_steps_in_stretches(share: float) -> None:
    noise = ActionNoise(torch.Generator().manual_seed(0), 0.9, quiet_share=share)
    drawn, quiet = [], []
    for _ in range(2000):
        drawn.append(noise.step(WORLDS, DIM))
        assert noise.quiet is not None
        quiet.append(noise.quiet)
    silent = torch.stack(quiet)
    assert torch.equal((torch.stack(drawn) == 0.0).all(-1), silent)
    torch.testing.assert_close(silent[0].double().mean().item(), share, atol=0.1, rtol=0)
    torch.testing.assert_close(silent.double().mean().item(), share, atol=0.02, rtol=0)
    ends = (silent[:-1] & ~silent[1:]).double().sum() / silent[:-1].double().sum()
    torch.testing.assert_close(1 / ends.item(), float(QUIET_STEPS), atol=3.0, rtol=0)


def test_the_noise_of_the_others_is_what_it_was() -> None:
    noise = ActionNoise(torch.Generator().manual_seed(0), quiet_share=0.5)
    first = noise.step(WORLDS, DIM)
    assert noise.quiet is not None
    assert torch.equal(first[~noise.quiet], drawn(0.0, 1)[0][~noise.quiet])


def test_quiet_worlds_are_quiet_still_when_it_goes_on() -> None:
    generator = torch.Generator().manual_seed(0)
    first = ActionNoise(generator, 0.9, quiet_share=0.5)
    first.step(WORLDS, DIM)
    kept, state = first.state_dict(), generator.get_state()
    expected = first.step(WORLDS, DIM)
    again = ActionNoise(generator, 0.9, quiet_share=0.5)
    again.load_state_dict(kept)
    generator.set_state(state)
    assert torch.equal(again.step(WORLDS, DIM), expected)
    other = ActionNoise(generator, 0.9, quiet_share=0.5)
    other.load_state_dict(kept)
    assert other.step(2, DIM).shape == (2, DIM)  # loaded to play in other worlds
