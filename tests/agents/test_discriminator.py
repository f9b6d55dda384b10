import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import Tensor, nn

from murmillo.agents.common.discriminator import (
    Condition,
    Discriminator,
    DiscriminatorConfig,
    Windows,
    style_reward,
)
from murmillo.agents.common.discriminator_loss import discriminator_loss, gradient_penalty
from murmillo.agents.common.errors import AgentError
from tests.agents.toy import make_ase, make_calm, make_case, make_runner, small_ase


def make(
    generator: torch.Generator, condition: Condition | None = None, hidden: tuple[int, ...] = (8, 4)
) -> Discriminator:
    return Discriminator(2, 3, DiscriminatorConfig(hidden=hidden), generator, condition)


def test_gradient_penalty_of_a_linear_and_a_quadratic_function() -> None:
    weight = torch.tensor([1.0, -2.0, 3.0])
    x = torch.randn(5, 3, requires_grad=True)
    assert gradient_penalty(x @ weight, x).item() == pytest.approx(14.0)  # ||w||^2 everywhere
    y = torch.tensor([[1.0, 2.0], [0.0, 3.0]], requires_grad=True)
    assert gradient_penalty(y.square().sum(1), y).item() == pytest.approx((4 * 5 + 4 * 9) / 2)  # E ||2 y||^2


def test_no_steps_an_iteration_are_refused() -> None:
    with pytest.raises(AgentError, match=r"agent\.discriminator\.updates=0: needs at least 1"):
        DiscriminatorConfig(updates=0)


def test_gradient_penalty_can_be_differentiated() -> None:
    weight = torch.tensor([1.0, -2.0, 3.0], requires_grad=True)
    x = torch.ones(5, 3, requires_grad=True)
    gradient_penalty(x @ weight, x).backward()
    assert weight.grad is not None
    assert weight.grad.tolist() == [2.0, -4.0, 6.0]  # d ||w||^2 / dw


def test_gradient_penalty_is_on_the_normalised_input(generator: torch.Generator) -> None:
    discriminator = make(generator)
    windows = torch.randn(50, 2, 3, generator=generator)
    scales = torch.tensor([1.0, 100.0, 1e4])
    penalties = []
    for scale in (torch.ones(3), scales):  # the same data in other units
        discriminator.normalizer = type(discriminator.normalizer)((3,))
        discriminator.normalizer.update(windows * scale)
        sample = Windows(windows * scale)
        loss = discriminator_loss(discriminator, sample, sample, sample, generator=generator)
        penalties.append(loss.parts["gradient_penalty"].item())
    assert penalties[0] > 0
    assert penalties[0] == pytest.approx(penalties[1], rel=1e-3)


def test_parts_of_the_loss_by_hand(generator: torch.Generator) -> None:
    discriminator = make(generator)
    with torch.no_grad():  # a network that answers its bias, whatever the window
        for layer in discriminator.trunk:
            if isinstance(layer, nn.Linear):
                layer.weight.fill_(0.0)
                layer.bias.fill_(0.0)
        discriminator.head.weight.fill_(0.5)
        discriminator.head.bias.fill_(math.log(3.0))  # D = 3/4
    sample = Windows(torch.randn(6, 2, 3, generator=generator))
    loss = discriminator_loss(discriminator, sample, Windows(sample.window[:2]), sample, generator=generator)
    parts = {name: part.item() for name, part in loss.parts.items()}
    assert parts["agent"] + parts["replay"] == pytest.approx(0.5 * math.log(4))  # -log(1 - 3/4)
    assert parts["agent"] == pytest.approx(3 * parts["replay"])  # each window counts alike
    assert parts["demonstration"] == pytest.approx(0.5 * math.log(4 / 3))
    assert parts["gradient_penalty"] == 0
    assert parts["logit_decay"] == pytest.approx(0.01 * 4 * 0.25)
    assert parts["weight_decay"] == pytest.approx(1e-4 * 4 * 0.25)
    assert loss.scores["agent_score"].item() == pytest.approx(0.75)
    assert loss.scores["demonstration_accuracy"].item() == 1.0
    assert loss.scores["agent_accuracy"].item() == 0.0


def test_the_hinge_by_hand(generator: torch.Generator) -> None:
    config = DiscriminatorConfig(loss="hinge", slope=0.5, gradient_penalty=10.0)
    discriminator = linear_one(torch.tensor([0.3, -0.4, 0.0]), config, generator)
    agent, replay, demonstration = (
        torch.tensor(value).expand(4, 1, 3) for value in ([5.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0])
    )
    loss = discriminator_loss(
        discriminator, Windows(agent), Windows(replay), Windows(demonstration), generator=generator
    )
    parts = {name: part.item() for name, part in loss.parts.items()}
    assert parts["agent"] == pytest.approx(0.25 * (1 + 1.5), rel=1e-4)  # two kinds of fakes share the half
    assert parts["replay"] == pytest.approx(0.25 * (1 + 0.3), rel=1e-4)
    assert parts["demonstration"] == pytest.approx(0.5 * (1 + 0.4), rel=1e-4)
    assert parts["gradient_penalty"] == pytest.approx(0.0, abs=1e-7)  # ||(0.3, -0.4)|| is the slope
    assert loss.scores["agent_score"].item() == 1.0  # a logit of 1.5 is beyond the clip
    assert loss.scores["demonstration_score"].item() == pytest.approx(0.3, rel=1e-4)
    config.slope = 0.25
    parts = discriminator_loss(
        discriminator, Windows(agent), Windows(replay), Windows(demonstration), generator=generator
    ).parts
    assert parts["gradient_penalty"].item() == pytest.approx(10.0, rel=1e-4)  # (0.5 / 0.25 - 1)^2


def test_the_hinge_is_flat_beyond_its_margins(generator: torch.Generator) -> None:
    config = DiscriminatorConfig(loss="hinge")
    discriminator = linear_one(torch.tensor([1.0, 0.0, 0.0]), config, generator)
    sure = [Windows(torch.tensor([x, 0.0, 0.0]).expand(4, 1, 3)) for x in (-3.0, 3.0)]
    parts = discriminator_loss(discriminator, sure[0], sure[0], sure[1], generator=generator).parts
    assert [parts[name].item() for name in ("agent", "replay", "demonstration")] == [0, 0, 0]


def test_the_hinges_penalty_is_between_agent_and_demonstrations(generator: torch.Generator) -> None:
    discriminator = Discriminator(1, 1, DiscriminatorConfig(hidden=(1,), loss="hinge", slope=1.0), generator)
    with torch.no_grad():  # logit = relu(x): slope 0 below 0, 1 above
        for layer in (discriminator.trunk[0], discriminator.head):
            assert isinstance(layer, nn.Linear)
            layer.weight.fill_(1.0)
            layer.bias.fill_(0.0)
    agent, demonstration = torch.full((4000, 1, 1), -3.0), torch.full((4000, 1, 1), 1.0)
    sample = Windows(agent)
    parts = discriminator_loss(discriminator, sample, sample, Windows(demonstration), generator=generator).parts
    assert parts["gradient_penalty"].item() == pytest.approx(5 * 0.75, rel=0.05)  # three quarters of the way are flat


def test_the_hinges_penalty_asks_nothing_of_what_is_left_out(generator: torch.Generator) -> None:
    config = DiscriminatorConfig(loss="hinge", slope=0.5)
    discriminator = linear_one(torch.tensor([0.3, -0.4, 7.0]), config, generator)
    mask = torch.tensor([False, False, True]).expand(4, 3)
    sample = Windows(torch.randn(4, 1, 3, generator=generator), mask=mask)
    parts = discriminator_loss(discriminator, sample, sample, sample, generator=generator).parts
    assert parts["gradient_penalty"].item() == pytest.approx(0.0, abs=1e-7)


def test_a_hinge_begins_about_as_steep_as_it_is_to_be(generator: torch.Generator) -> None:
    for slope in (0.0625, 0.5):
        config = DiscriminatorConfig(hidden=(256, 256), loss="hinge", slope=slope, gradient_penalty=1.0)
        discriminator = Discriminator(10, 120, config, generator)
        agent, demonstration = (Windows(torch.randn(64, 10, 120, generator=generator)) for _ in range(2))
        parts = discriminator_loss(discriminator, agent, agent, demonstration, generator=generator).parts
        assert parts["gradient_penalty"] < 1.0  # between no slope and twice the one that is asked for


def linear_one(weight: Tensor, config: DiscriminatorConfig, generator: torch.Generator) -> Discriminator:
    """Logits w x of windows of one frame, which are not scaled."""
    discriminator = Discriminator(1, 3, config, generator, trunk=nn.Sequential(nn.Flatten()))
    discriminator.head = nn.Linear(3, 1, bias=False)
    discriminator.head.weight.data[:] = weight
    return discriminator


def test_scores_and_rewards(generator: torch.Generator) -> None:
    logits = torch.tensor([-5.0, -1.0, 0.0, 0.5, 1.0, 9.0])
    logistic, hinge = (
        Discriminator(1, 3, DiscriminatorConfig(hidden=(4,), loss=loss), generator) for loss in ("logistic", "hinge")
    )
    assert hinge.score(logits).tolist() == [0, 0, 0.5, 0.75, 1, 1]
    assert torch.equal(hinge.reward(logits), hinge.score(logits))
    assert torch.equal(logistic.score(logits), logits.sigmoid())
    assert torch.equal(logistic.reward(logits), style_reward(logits))
    for discriminator in (logistic, hinge):
        torch.testing.assert_close(discriminator.score_of(discriminator.reward(logits)), discriminator.score(logits))


def test_an_unknown_loss_is_refused() -> None:
    with pytest.raises(AgentError, match=r"agent\.discriminator\.loss=wgan is not one of logistic, hinge"):
        DiscriminatorConfig(loss="wgan")
    with pytest.raises(AgentError, match=r"agent\.discriminator\.slope=0"):
        DiscriminatorConfig(slope=0)


def test_style_reward() -> None:
    reward = style_reward(torch.tensor([0.0, 100.0, -100.0]))
    assert reward.tolist() == pytest.approx([math.log(2), -math.log(1e-4), 0.0], abs=1e-6)
    assert style_reward(torch.tensor(0.0), scale=2.0).item() == pytest.approx(2 * math.log(2))


@pytest.mark.parametrize("loss_name", ["logistic", "hinge"])
def test_it_learns_to_tell_two_clouds_apart(loss_name: str, generator: torch.Generator) -> None:
    config = DiscriminatorConfig(hidden=(32, 32), loss=loss_name, slope=1.0)
    discriminator = Discriminator(2, 3, config, generator)
    optimizer = torch.optim.Adam(discriminator.parameters(), lr=3e-3)
    for _ in range(150):
        agent = torch.randn(64, 2, 3, generator=generator) - 1
        demonstration = torch.randn(64, 2, 3, generator=generator) + 1
        loss = discriminator_loss(
            discriminator, Windows(agent), Windows(agent), Windows(demonstration), generator=generator
        )
        optimizer.zero_grad()
        torch.stack(list(loss.parts.values())).sum().backward()
        optimizer.step()
    assert loss.scores["agent_accuracy"] > 0.9
    assert loss.scores["demonstration_accuracy"] > 0.9
    assert loss.scores["agent_score"] < 0.3 < 0.7 < loss.scores["demonstration_score"]


class Beside(Condition):
    """The condition stands beside the window, as CALM's latent."""

    inputs = 2

    def join(self, x: Tensor, condition: Tensor | None) -> Tensor:
        assert condition is not None
        return torch.cat([x, condition], -1)


class Column(Condition):
    """The condition picks an output, as C·ASE's label."""

    outputs = 3

    def pick(self, logits: Tensor, condition: Tensor | None) -> Tensor:
        assert condition is not None
        return logits.gather(1, condition[:, None])[:, 0]


@pytest.mark.parametrize(
    ("strategy", "told"),
    [(Beside(), torch.eye(2)[[0, 1, 0, 1, 1]]), (Column(), torch.tensor([0, 1, 2, 1, 0]))],
    ids=["beside", "column"],
)
def test_a_condition_plugs_in_without_a_new_loss(strategy: Condition, told: Tensor, generator: torch.Generator) -> None:
    discriminator = make(generator, strategy)
    window = torch.randn(1, 2, 3, generator=generator).expand(5, 2, 3)
    logits = discriminator.logits(window, told)
    assert logits.shape == (5,)
    assert logits[0] != logits[1]  # the same window, judged by another condition
    assert logits[1] == logits[3]
    sample = Windows(window, told)
    parts = discriminator_loss(discriminator, sample, sample, sample, generator=generator).parts
    torch.stack(list(parts.values())).sum().backward()
    assert all(parameter.grad is not None for parameter in discriminator.parameters())


def test_a_penalty_now_and_then_weighs_as_much_as_one_always(generator: torch.Generator) -> None:
    fake, real = (Windows(torch.randn(50, 2, 3, generator=generator)) for _ in range(2))
    for loss_name in ("logistic", "hinge"):
        always, seldom = (
            Discriminator(
                2,
                3,
                DiscriminatorConfig(hidden=(8, 4), loss=loss_name, updates=8, penalty_every=every),
                torch.Generator().manual_seed(1),
            )
            for every in (1, 4)
        )
        penalties: dict[int, list[float]] = {1: [], 4: []}
        for update in range(8):
            for discriminator in (always, seldom):
                draw = torch.Generator().manual_seed(2)
                parts = discriminator_loss(discriminator, fake, fake, real, generator=draw, update=update).parts
                penalties[discriminator.config.penalty_every].append(parts["gradient_penalty"].item())
                assert parts["demonstration"] > 0
        assert [penalty > 0 for penalty in penalties[4]] == [True, False, False, False] * 2
        assert sum(penalties[4]) == pytest.approx(sum(penalties[1]))


def test_a_penalty_that_no_iteration_has_evenly_is_refused() -> None:
    with pytest.raises(AgentError, match=r"agent\.discriminator\.penalty_every=3: needs a divisor of updates=8"):
        DiscriminatorConfig(updates=8, penalty_every=3)
    with pytest.raises(AgentError, match=r"agent\.discriminator\.penalty_every=0: needs at least 1"):
        DiscriminatorConfig(penalty_every=0)


@pytest.mark.parametrize("make", [make_ase, make_calm, make_case])
def test_every_agent_says_which_update_it_is(make: Callable, tmp_path: Path) -> None:
    penalties = []
    for every in (1, 8):
        config = replace(small_ase().discriminator, updates=8, penalty_every=every)
        weights = {"style": 1.0} if make is make_calm else {"style": 1.0, "skill": 0.5}
        runner = make_runner(tmp_path, make=make, samples=1, agent={"discriminator": config}, reward_weights=weights)
        runner.on_iteration = [lambda stats: penalties.append(stats["discriminator/gradient_penalty"])]
        runner.run()
    assert 0 < penalties[1] < 4 * penalties[0]  # eight times it, were all eight taken for the first
