import pytest
import torch

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.replay import Replay


def rows(start: int, stop: int) -> dict[str, torch.Tensor]:
    number = torch.arange(start, stop)
    return {"window": number[:, None, None].expand(-1, 2, 3).float(), "number": number}


def contents(replay: Replay, generator: torch.Generator) -> set[int]:
    return set(replay.sample(5000, generator)[0]["number"].tolist())


def test_it_fills_up_first_and_then_admits_few(generator: torch.Generator) -> None:
    replay = Replay(100, keep=0.1)
    replay.add(rows(0, 60), generator)
    assert contents(replay, generator) == set(range(60))
    replay.add(rows(60, 100), generator)
    assert contents(replay, generator) == set(range(100))
    replay.add(rows(1000, 1300), generator)
    newcomers = {number for number in contents(replay, generator) if number >= 1000}
    assert len(replay) == 100
    assert 15 <= len(newcomers) <= 50  # 300 x 0.1


def test_one_batch_larger_than_the_whole_memory(generator: torch.Generator) -> None:
    replay = Replay(10, keep=1.0)
    replay.add(rows(0, 35), generator)
    assert contents(replay, generator) == set(range(25, 35))


def test_fields_stay_together(generator: torch.Generator) -> None:
    replay = Replay(50, keep=0.5)
    for start in range(0, 200, 20):
        replay.add(rows(start, start + 20), generator)
    sample, _ = replay.sample(64, generator)
    assert torch.equal(sample["window"][:, 1, 2].long(), sample["number"])


def test_state_continues_exactly(generator: torch.Generator) -> None:
    replay, other = Replay(10, keep=0.5), Replay(10, keep=0.5)
    replay.add(rows(0, 10), generator)
    replay.add(rows(10, 15), generator)
    other.load_state_dict(replay.state_dict())
    state = generator.get_state()
    samples = []
    for memory in (replay, other):
        generator.set_state(state)
        memory.add(rows(20, 40), generator)
        samples.append(memory.sample(100, generator)[0]["number"])
    assert torch.equal(*samples)


def test_another_capacity_is_refused(generator: torch.Generator) -> None:
    replay = Replay(10)
    replay.add(rows(0, 3), generator)
    with pytest.raises(AgentError, match="capacity"):
        Replay(11).load_state_dict(replay.state_dict())
