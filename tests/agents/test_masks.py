"""What a clip leaves out has no influence: not on logits, gradients, scales, rewards or a whole training iteration."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from murmillo.agents.common.discriminator import Discriminator, DiscriminatorConfig, Windows
from murmillo.agents.common.discriminator_loss import discriminator_loss
from murmillo.agents.common.masks import FeatureMasks
from murmillo.agents.common.normalizer import RunningNormalizer
from murmillo.agents.common.runner import Runner, RunnerConfig
from tests.agents.toy import PointMass, make_ase, make_calm, make_case

LEFT_OUT = 1
"""The feature of the toy's state, the second of the position, that masked clips say nothing of."""


class Masked:
    """The toy's demonstrations; those that move to the right, or of skill 0, have made up one feature."""

    def __init__(self, env: PointMass, made_up: float, everywhere: bool = False) -> None:
        self.whole, self.skills = env.demonstrations, env.skills
        self.made_up, self.everywhere = made_up, everywhere

    def __call__(
        self,
        n: int,
        generator: torch.Generator,
        skill: Tensor | None = None,
        frames: int | None = None,
        rows: Tensor | slice | None = None,
    ) -> dict[str, Tensor]:
        drawn = self.whole(n, generator, skill, frames, rows)
        hidden = drawn["skill"] == 0 if self.skills > 1 else drawn["window"][:, -1, 2] > 0
        mask = torch.zeros(len(hidden), 4, dtype=torch.bool)
        mask[hidden | self.everywhere, LEFT_OUT] = True
        return {**drawn, "window": drawn["window"].masked_fill(mask[:, None], self.made_up), "mask": mask}


def test_masked_features_have_no_influence_on_logits_and_gradients(generator: torch.Generator) -> None:
    config = DiscriminatorConfig(hidden=(8, 4))
    discriminator = Discriminator(2, 3, config, generator)
    windows = torch.randn(6, 2, 3, generator=generator)
    mask = torch.zeros(6, 3, dtype=torch.bool)
    mask[:4, LEFT_OUT] = True
    results = []
    for made_up in (0.3, 77.0):
        sample = Windows(windows.masked_fill(mask[:, None], made_up), mask=mask)
        discriminator.zero_grad()
        loss = discriminator_loss(discriminator, sample, sample, sample, generator=generator)
        torch.stack(list(loss.parts.values())).sum().backward()
        gradients = [parameter.grad.clone() for parameter in discriminator.parameters() if parameter.grad is not None]
        results.append([discriminator.logits(*sample[:3]), *loss.parts.values(), *gradients])
    assert all(torch.equal(one, other) for one, other in zip(*results, strict=True))
    kept = Windows(windows.masked_fill(mask[:, None], 77.0))
    assert not torch.equal(discriminator.logits(*kept[:3]), results[0][0])  # without the mask they have


def test_the_gradient_penalty_asks_nothing_of_what_is_left_out(generator: torch.Generator) -> None:
    discriminator = Discriminator(1, 3, DiscriminatorConfig(hidden=(8, 4)), generator)
    windows = torch.randn(6, 1, 3, generator=generator)
    everything = torch.ones(6, 3, dtype=torch.bool)
    sample = Windows(windows, mask=everything)
    assert discriminator_loss(discriminator, sample, sample, sample, generator=generator).parts["gradient_penalty"] == 0


def test_a_normaliser_learns_from_what_is_there(generator: torch.Generator) -> None:
    rows = torch.randn(50, 2, 3, generator=generator) + 4
    left_out = torch.zeros(50, 3, dtype=torch.bool)
    left_out[:20, 0] = True
    left_out[:, 2] = True
    normalizer = RunningNormalizer((3,))
    normalizer.update(rows.masked_fill(left_out[:, None], 1e6), left_out[:, None])
    torch.testing.assert_close(normalizer.mean[0], rows[20:, :, 0].double().mean())
    torch.testing.assert_close(normalizer.var[0], rows[20:, :, 0].double().var(correction=0))
    torch.testing.assert_close(normalizer.mean[1], rows[:, :, 1].double().mean())
    assert (normalizer.mean[2], normalizer.var[2]) == (0.0, 1.0)  # never seen: as at first


def test_masks_for_the_agent_are_distributed_like_those_of_the_demonstrations(generator: torch.Generator) -> None:
    masks = FeatureMasks(Masked(PointMass(1), 0.0))
    drawn = masks.draw(4000, generator)
    assert drawn is not None
    assert drawn[:, LEFT_OUT].float().mean().item() == pytest.approx(0.5, abs=0.05)
    assert not drawn[:, [0, 2, 3]].any()


def test_masks_of_a_label_are_those_of_its_clips(generator: torch.Generator) -> None:
    masks = FeatureMasks(Masked(PointMass(1, skills=3), 0.0), skills=3)
    label = torch.arange(90) % 3
    drawn = masks.draw(90, generator, label)
    assert drawn is not None
    assert torch.equal(drawn[:, LEFT_OUT], label == 0)


def test_case_leaves_out_of_its_own_windows_what_the_clips_of_the_label_do(generator: torch.Generator) -> None:
    env = PointMass(4, skills=3)
    env.demonstrations = Masked(env, 0.0)  # type: ignore[method-assign]
    label = torch.arange(30) % 3
    mask = make_case(env, generator)._agent_windows(torch.zeros(30, 3, 4), label).mask
    assert mask is not None
    assert torch.equal(mask[:, LEFT_OUT], label == 0)


def test_a_mask_that_few_clips_of_a_label_have_is_not_missed(generator: torch.Generator) -> None:
    env = PointMass(1, skills=2)

    def one_in_twenty(n: int, generator: torch.Generator, *args: Any, **kwargs: Any) -> dict[str, Tensor]:
        mask = torch.zeros(n, 4, dtype=torch.bool)
        mask[:, LEFT_OUT] = torch.rand(n, generator=generator) < 0.05
        return {**env.demonstrations(n, generator, *args, **kwargs), "mask": mask}

    drawn = FeatureMasks(one_in_twenty, skills=2).draw(20_000, generator, torch.arange(20_000) % 2)
    assert drawn is not None
    share = drawn[:, LEFT_OUT].unflatten(0, (-1, 2)).float().mean(0)
    assert share.tolist() == pytest.approx([0.05, 0.05], abs=0.04)


def test_where_nothing_is_left_out_nothing_is_drawn(generator: torch.Generator) -> None:
    env = PointMass(1, skills=2)

    def all_whole(n: int, *args: Any, **kwargs: Any) -> dict[str, Tensor]:
        return {**env.demonstrations(n, *args, **kwargs), "mask": torch.zeros(n, 4, dtype=torch.bool)}

    state = generator.get_state()
    for demonstrations in (env.demonstrations, all_whole):
        assert FeatureMasks(demonstrations).draw(5, generator) is None
        assert FeatureMasks(demonstrations, skills=2).draw(5, generator, torch.zeros(5, dtype=torch.int64)) is None
    assert torch.equal(state, generator.get_state())


@pytest.mark.parametrize(("make", "skills"), [(make_ase, 1), (make_case, 3)], ids=["ase", "case"])
def test_what_clips_made_up_changes_nothing_in_training(make: Callable, skills: int, tmp_path: Path) -> None:
    histories = []
    for made_up in (0.0, 50.0):
        generator = torch.Generator().manual_seed(0)
        env = PointMass(16, skills=skills)
        env.demonstrations = Masked(env, made_up)  # type: ignore[method-assign]
        settings = RunnerConfig(samples=3 * 16 * 8, horizon=8)
        runner = Runner(env, make(env, generator), settings, generator, tmp_path)
        histories.append([])
        runner.on_iteration = [histories[-1].append]
        runner.run()
    for one, other in zip(*histories, strict=True):
        assert {**one, "samples_per_second": 0} == pytest.approx({**other, "samples_per_second": 0}, rel=0, nan_ok=True)


@pytest.mark.parametrize(
    ("make", "skills"), [(make_ase, 1), (make_case, 3), (make_calm, 1)], ids=["ase", "case", "calm"]
)
def test_rewards_do_not_look_at_what_every_clip_leaves_out(make: Callable, skills: int, tmp_path: Path) -> None:
    generator = torch.Generator().manual_seed(0)
    env = PointMass(16, skills=skills)
    env.demonstrations = Masked(env, 0.0, everywhere=True)  # type: ignore[method-assign]
    runner = Runner(env, make(env, generator), RunnerConfig(horizon=8), generator, tmp_path)
    rollout = runner._collect()
    before = runner.agent.rewards(rollout)
    rollout["next_window"][..., LEFT_OUT] = 9.0
    after = runner.agent.rewards(rollout)
    assert all(torch.equal(before[name], after[name]) for name in before)
    rollout["next_window"][..., 0] = 9.0
    assert not torch.equal(before["style"], runner.agent.rewards(rollout)["style"])
