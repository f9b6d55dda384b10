import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.ranks import Ranks
from murmillo.agents.common.rollout import Rollout, true_next_obs


class Counter(gym.Env):
    """Counts up from 0 and ends at `last`."""

    observation_space = spaces.Dict({"state": spaces.Box(0, 99, (1,), np.float32)})
    action_space = spaces.Box(-1, 1, (1,))

    def __init__(self, last: int) -> None:
        self.last = last

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[dict, dict]:
        self.count = 0
        return self._obs(), {}

    def step(self, action: np.ndarray) -> tuple[dict, float, bool, bool, dict]:
        self.count += 1
        return self._obs(), 0.0, self.count == self.last, False, {}

    def _obs(self) -> dict[str, np.ndarray]:
        return {"state": np.array([self.count], np.float32)}


def test_true_successors_of_gymnasiums_own_vector_env() -> None:
    env = SyncVectorEnv([lambda: Counter(2), lambda: Counter(3)], autoreset_mode=AutoresetMode.SAME_STEP)
    env.reset()
    seen, successors = [], []
    for _ in range(4):
        obs, _, _, _, infos = env.step(np.zeros((2, 1), np.float32))
        successors.append(true_next_obs(obs, infos)["state"][:, 0].tolist())
        seen.append(obs["state"][:, 0].tolist())
    assert successors == [[1, 1], [2, 2], [1, 3], [2, 1]]
    assert seen == [[1, 1], [0, 2], [1, 0], [0, 1]]
    env.close()


def test_true_successors_of_a_dict_of_arrays() -> None:
    obs = {"state": np.zeros((2, 1)), "skill": np.array([1, 2])}
    final = {"state": np.ones((2, 1)), "skill": np.array([3, 4])}
    successor = true_next_obs(obs, {"final_obs": final})
    assert successor["state"].dtype == torch.float32
    assert successor["skill"].tolist() == [3, 4]
    assert true_next_obs(obs, {})["skill"].tolist() == [1, 2]


def test_an_observation_without_names_is_refused() -> None:
    with pytest.raises(AgentError, match="dict"):
        true_next_obs(np.zeros((2, 3)), {})


def test_fields_keep_their_kind_and_are_copies() -> None:
    rollout = Rollout(horizon=2, num_envs=3)
    live = torch.ones(3, 4, dtype=torch.float64)
    for t in range(2):
        rollout.store(
            t, {"state": live * t, "skill": torch.tensor([t, 1, 2]), "done": torch.tensor([True, False, True])}
        )
    live.zero_()
    assert {name: rollout[name].dtype for name in ("state", "skill", "done")} == {
        "state": torch.float32,
        "skill": torch.int64,
        "done": torch.bool,
    }
    assert rollout["state"].shape == (2, 3, 4)
    assert rollout.flat("state").sum() == 12
    assert rollout.flat("skill").tolist() == [0, 1, 2, 1, 1, 2]


def test_a_missing_or_misshapen_field_is_named() -> None:
    rollout = Rollout(2, 3)
    with pytest.raises(KeyError, match="reward"):
        rollout["reward"]
    with pytest.raises(ValueError, match="reward"):
        rollout["reward"] = torch.zeros(3, 2)


@pytest.mark.parametrize("size", [1, 4, 6, 100])
def test_minibatches_visit_every_row_once(size: int, generator: torch.Generator) -> None:
    batches = [rows for rows, _ in Rollout(2, 3).minibatches(size, generator)]
    assert sorted(torch.cat(batches).tolist()) == list(range(6))
    assert max(len(batch) for batch in batches) == min(size, 6)


class Together(Ranks):
    """One of two ranks, which are told what the other would say: that it leaves out nothing, or three rows."""

    def sum(self, x: torch.Tensor) -> torch.Tensor:
        if x.dtype == torch.bool:
            return torch.tensor(True)
        return torch.tensor([12 - 3, 12]) if len(x) == 2 else x


def test_minibatches_of_ranks_go_without_the_rows_that_one_of_them_leaves_out() -> None:
    parts = []
    for rank in (0, 1):
        rollout = Rollout(4, 3, Together(rank, 2))
        left_out = torch.zeros(4, 3, dtype=torch.bool)
        left_out[1, :] = rank == 0
        rollout.leave_out(left_out)
        assert rollout.alike().part is rollout.part
        batches = list(rollout.minibatches(8, torch.Generator().manual_seed(0)))
        parts.append(torch.cat([rows for rows, part in batches if part.weight]).sort().values.tolist())
        assert sum(part.total for _, part in batches) == 21
        rollout["number"] = torch.arange(12).view(4, 3)
        assert rollout.flat("number").tolist() == ([0, 1, 2, *range(6, 12)] if rank == 0 else list(range(12)))
    assert parts == [list(range(9)), list(range(12))]
    assert rollout.all_samples == 24


def test_rows_that_were_left_out_come_back_in_the_next_iteration() -> None:
    rollout = Rollout(2, 3)
    rollout["number"] = torch.arange(6).view(2, 3)
    rollout.leave_out(torch.tensor([[False, True, False], [False, False, True]]))
    assert rollout.flat("number").tolist() == [0, 2, 3, 4]
    rollout.leave_out(torch.zeros(2, 3, dtype=torch.bool))
    assert rollout.flat("number").tolist() == list(range(6))
    assert sorted(torch.cat([rows for rows, _ in rollout.minibatches(4, torch.Generator())]).tolist()) == list(range(6))
