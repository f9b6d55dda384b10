import math

import pytest
import torch
from torch import Tensor, nn

from murmillo.agents.adaptnet.ensemble import Ensemble, EnsembleConfig, hinge_loss, imitation_reward
from murmillo.agents.adaptnet.networks import HistoryCritic, HistoryEncoder, RecurrentPolicy
from murmillo.agents.common.discriminator import Windows
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.exploration import ActionNoise
from murmillo.agents.common.heights import HeightMapEncoder
from murmillo.agents.common.popart import PopArt
from murmillo.agents.common.recurrent import LastOutput


def test_the_last_valid_output_is_read_and_padding_is_not(generator: torch.Generator) -> None:
    reader = LastOutput(3, 5, generator)
    frames = torch.randn(2, 6, 4, 3, generator=generator)
    length = torch.tensor([1, 2, 3, 4, 4, 1]).repeat(2, 1)
    read = reader(frames, length)
    assert read.shape == (2, 6, 5)
    for n in range(6):
        torch.testing.assert_close(read[:, n], reader.gru(frames[:, n, : length[0, n]])[0][:, -1])
    padded = frames.masked_fill((torch.arange(4) >= length[..., None])[..., None], 7.0)
    assert torch.equal(read, reader(padded, length))
    torch.testing.assert_close(reader(frames), reader(frames, torch.full((2, 6), 4)))


def make_policy(generator: torch.Generator, std: float = 0.05) -> RecurrentPolicy:
    return RecurrentPolicy(HistoryEncoder(3, 2, 8, generator), 4, (16, 16), std, generator)


def test_the_standard_deviation_begins_as_configured_and_depends_on_the_state(generator: torch.Generator) -> None:
    policy = make_policy(generator)
    state, told = torch.randn(9, 4, 3, generator=generator), {"goal": torch.randn(9, 2, generator=generator)}
    mean, log_std = policy.moments(policy(state, told))
    torch.testing.assert_close(log_std.exp(), torch.full((9, 4), 0.05), rtol=1e-3, atol=0)
    with torch.no_grad():
        policy.spread.weight *= 1e4
    mean, log_std = policy.moments(parameters := policy(state, told))
    assert log_std.std(0).min() > 0.01
    action = policy.sample(parameters, ActionNoise(generator))
    by_torch = torch.distributions.Normal(mean, log_std.exp())
    torch.testing.assert_close(policy.log_prob(action, parameters), by_torch.log_prob(action).sum(-1))
    torch.testing.assert_close(policy.entropy(parameters), by_torch.entropy().sum(-1))


def test_the_standard_deviation_does_not_shrink_below_its_least(generator: torch.Generator) -> None:
    policy = RecurrentPolicy(HistoryEncoder(3, 2, 8, generator), 4, (16, 16), 0.05, generator, std_least=0.045)
    state, told = torch.randn(9, 4, 3, generator=generator), {"goal": torch.randn(9, 2, generator=generator)}
    with torch.no_grad():
        policy.spread.weight *= 1e4
    std = policy.moments(policy(state, told))[1].exp().detach()
    free = make_policy(generator)
    free.load_state_dict(policy.state_dict())
    torch.testing.assert_close(std, free.moments(free(state, told))[1].exp().detach().clamp_min(0.045))
    assert std.min() == pytest.approx(0.045, rel=1e-4)
    assert std.max() > 0.05


def test_a_goal_and_a_map_change_what_is_done(generator: torch.Generator) -> None:
    encoder = HistoryEncoder(3, 2, 8, generator, [HeightMapEncoder(generator)])
    assert encoder.size == 8 + 2 + 256
    critic = HistoryCritic(encoder, (16,), 2, generator)
    nn.init.ones_(critic.head.weight)
    state = torch.randn(1, 4, 3, generator=generator).expand(3, 4, 3)
    told = {"goal": torch.tensor([[0.0, 1], [0, 1], [1, 0]]), "heights": torch.zeros(3, 35, 35)}
    told["heights"][1] = 1.0
    values = critic(state, told)
    assert values.shape == (3, 2)
    assert len({round(value.item(), 6) for value in values[:, 0]}) == 3
    stacked = critic(state.expand(2, 3, 4, 3), {name: value.expand(2, *value.shape) for name, value in told.items()})
    torch.testing.assert_close(stacked, values.expand(2, 3, 2))
    # of several views of a state it looks at the last, which learns on
    assert torch.equal(critic(torch.cat([torch.randn(3, 4, 3, generator=generator), state], -1), told), values)


def test_popart_by_hand() -> None:
    head = nn.Linear(1, 2)
    popart = PopArt(head, momentum=0.1)
    first, second = torch.tensor([[1.0, 10], [3, 30]]), torch.tensor([[5.0, 0], [5, 0]])
    assert torch.equal(popart(first), first)
    popart.update(first)
    torch.testing.assert_close(popart(first), torch.tensor([[-1.0, -1], [1, 1]]))  # all that it knows
    popart.update(second)
    # moving averages of both, 0.9 x 0.1 to 0.1, without the bias of their beginning
    mean = (0.09 * 2 + 0.1 * 5) / 0.19
    square = (0.09 * 5 + 0.1 * 25) / 0.19
    std = math.sqrt(square - mean**2)
    torch.testing.assert_close(popart(torch.tensor([[4.0, 0]]))[0, 0].item(), (4 - mean) / std)
    torch.testing.assert_close(popart.inverse(popart(second)), second)


def test_popart_moves_no_prediction(generator: torch.Generator) -> None:
    head = nn.Linear(6, 2)
    popart = PopArt(head)
    x = torch.randn(20, 6, generator=generator)
    popart.update(torch.randn(50, 2, generator=generator))
    before = popart.inverse(head(x))
    popart.update(100 + 30 * torch.randn(50, 2, generator=generator))
    torch.testing.assert_close(popart.inverse(head(x)), before, rtol=1e-4, atol=1e-4)
    assert not torch.allclose(head(x), before)


def make_ensemble(generator: torch.Generator, weight: Tensor) -> Ensemble:
    """Discriminators w_n x on windows of one frame, in raw units."""
    heads, features = weight.shape
    ensemble = Ensemble(1, features, EnsembleConfig(recurrent=2, hidden=(features,), heads=heads), generator)
    ensemble.trunk = nn.Sequential()
    ensemble.normalizer.eps = 0.0
    with torch.no_grad():
        ensemble.head.weight.copy_(weight)
        ensemble.head.bias.zero_()
    return ensemble


def test_the_hinge_loss_by_hand(generator: torch.Generator) -> None:
    ensemble = make_ensemble(generator, torch.tensor([[1.0, 0], [2, 4]]))
    agent, real = Windows(torch.tensor([[[1.0, 0]], [[-2, 0]]])), Windows(torch.tensor([[[0.5, 0]], [[0, 1]]]))
    parts, scores = hinge_loss(ensemble, agent, real, 10.0, generator)
    assert parts["agent"].item() == pytest.approx((2 + 3 + 0 + 0) / 4)  # scores 1, 2 and -2, -4
    assert parts["demonstration"].item() == pytest.approx((0.5 + 0 + 1 + 0) / 4)  # scores 0.5, 1 and 0, 4
    assert parts["gradient_penalty"].item() == pytest.approx(10 * (5 - 1) ** 2)  # ||(1, 0) + (2, 4)|| = 5
    assert scores["agent_accuracy"] == 0.5
    assert scores["demonstration_accuracy"] == 1.0


def test_the_penalty_is_between_the_windows(generator: torch.Generator) -> None:
    """A discriminator x^2 / 2 has the gradient x."""
    ensemble = make_ensemble(generator, torch.ones(1, 1))
    ensemble.features = lambda x, condition=None: x.square() / 2  # type: ignore[method-assign]  # a function to know
    agent, real = Windows(torch.full((4000, 1, 1), 1.0)), Windows(torch.full((4000, 1, 1), 4.0))
    parts, _ = hinge_loss(ensemble, agent, real, 1.0, generator)
    assert parts["gradient_penalty"].item() == pytest.approx(3.0, rel=0.05)  # E u^2 with u uniform in [0, 3]


def test_the_imitation_reward_clips_each_head() -> None:
    assert imitation_reward(torch.tensor([[5.0, -0.5], [-3, -3]])).tolist() == [0.25, -1.0]


def test_the_heads_see_different_things(generator: torch.Generator) -> None:
    ensemble = Ensemble(5, 3, EnsembleConfig(recurrent=16, hidden=(32, 16), heads=8), generator)
    torch.testing.assert_close(ensemble.head.weight @ ensemble.head.weight.T, torch.eye(8), atol=1e-5, rtol=0)
    window = torch.randn(4, 5, 3, generator=generator)
    logits = ensemble.logits(window)
    assert logits.shape == (4, 8)
    assert not torch.allclose(logits, ensemble.logits(window.flip(1)))  # in time


def test_no_heads_are_refused() -> None:
    with pytest.raises(AgentError, match=r"agent\.discriminator\.heads=0: needs at least 1"):
        EnsembleConfig(heads=0)
