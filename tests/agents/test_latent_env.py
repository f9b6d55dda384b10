"""Decisions over the toy: how many steps they take, what they are worth, where they end, and that a policy learns."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

from murmillo.agents.common import checkpoint
from murmillo.agents.common.decoder import Command, SphereDecoder, to_sphere
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.latent_env import LatentEnv, LatentEnvConfig
from murmillo.agents.common.latents import sample_sphere
from murmillo.agents.common.rollout import Rollout, tensors, true_next_obs
from murmillo.agents.common.runner import Runner, RunnerConfig
from tests.agents.toy import PointMass, equal, make_ase, make_calm, make_case, make_runner
from tests.agents.toy_tasks import Compass, Heading, make_task

N = 40
WEIGHTS = {"task": 0.9, "style": 0.1}


def begun(env: Any, low: Any = None, seed: int = 3, **arguments: Any) -> LatentEnv:
    latent_env = LatentEnv(env, low or Compass(), **arguments)
    latent_env.reset(seed=seed)
    return latent_env


def replay(env: PointMass, actions: list[torch.Tensor], seed: int = 3) -> list[tuple]:
    """What the environment gives for these actions from its reset on."""
    env.reset(seed=seed)
    return [env.step(action.numpy()) for action in actions]


def test_a_decision_is_five_steps_under_one_latent(generator: torch.Generator) -> None:
    env, low = Heading(N, bound=9.0), Compass()
    latent_env = begun(env, low)
    obs, reward, terminated, truncated, infos = latent_env.step(torch.randn(N, 3, generator=generator).numpy())
    assert len(low.seen) == 5
    assert (env.clock == 5).all()
    assert all(torch.equal(latent, low.seen[0][0]) for latent, _ in low.seen)
    assert not (terminated | truncated).any()
    assert not infos["_final_obs"].any()
    steps = replay(Heading(N, bound=9.0), [low.seen[0][0][:, :2]] * 5)
    np.testing.assert_allclose(reward, np.mean([step[1] for step in steps], 0))
    np.testing.assert_allclose(infos["reward_terms"]["along"], reward)
    np.testing.assert_allclose(
        infos["side_rewards"]["speed"], np.mean([s[4]["side_rewards"]["speed"] for s in steps], 0)
    )
    x = np.mean([step[4]["final_obs"]["state"][:, 0] for step in steps], 0)
    np.testing.assert_allclose(infos["side_rewards"]["style"], x, rtol=1e-6)
    assert infos["side_rewards"].keys() == {"speed", "style"}  # of the agent's two terms the one that was named
    for name, value in obs.items():
        np.testing.assert_array_equal(value, steps[-1][0][name])
        np.testing.assert_array_equal(infos["final_obs"][name], value)


@pytest.mark.parametrize("steps", [1, 3])
def test_the_length_of_a_decision_is_configurable(steps: int) -> None:
    env = Heading(4)
    begun(env, config=LatentEnvConfig(steps=steps)).step(torch.ones(4, 3))
    assert (env.clock == steps).all()


def test_an_end_within_a_decision_ends_it(generator: torch.Generator) -> None:
    """By leaving the field at any step, and by the clock in the fourth of the second decision."""

    def toy() -> Heading:
        return Heading(N, episode_steps=9, bound=0.5)

    actions: list[torch.Tensor] = []
    latent_env = begun(toy(), on_step=[lambda action, results: actions.append(action.clone())])
    decisions = [latent_env.step(torch.randn(N, 3, generator=generator)) for _ in range(2)]
    steps = replay(toy(), actions)
    ended_at = set()
    for number, (_, reward, terminated, truncated, infos) in enumerate(decisions):
        five = steps[5 * number : 5 * number + 5]
        for world in range(N):
            ends = [t for t, step in enumerate(five) if step[2][world] or step[3][world]]
            last = ends[0] if ends else 4
            ended_at |= set(ends[:1])
            assert reward[world] == pytest.approx(sum(step[1][world] for step in five[: last + 1]) / 5)
            x = sum(step[4]["final_obs"]["state"][world, 0] for step in five[: last + 1]) / 5
            assert infos["side_rewards"]["style"][world] == pytest.approx(x, rel=1e-5)
            assert terminated[world] == five[last][2][world]
            assert truncated[world] == five[last][3][world]
            assert infos["_final_obs"][world] == bool(ends)
            for name, value in infos["final_obs"].items():
                np.testing.assert_array_equal(value[world], five[last][4]["final_obs"][name][world])
    assert ended_at == {0, 1, 2, 3, 4}
    assert decisions[1][3].any()
    assert not (decisions[1][2] & decisions[1][3]).any()
    for name, value in decisions[1][0].items():  # what the next decision sees is the new episode's
        np.testing.assert_array_equal(value, steps[-1][0][name])


def test_a_second_end_of_another_kind_within_a_decision_is_told_to_nobody() -> None:
    """Who begins beyond the bound terminates in the first step, and its next episode truncates two steps later."""
    env = Heading(N, episode_steps=2, bound=0.45)
    latent_env = begun(env)
    beyond = np.abs(env.history[:, -1, :2]).max(1) > 0.45
    _, _, terminated, truncated, _ = latent_env.step(np.tile([0.0, 0, 1], (N, 1)))
    assert beyond.any()
    np.testing.assert_array_equal(terminated, beyond)
    np.testing.assert_array_equal(truncated, ~beyond)


def test_a_second_end_within_a_decision_is_told_to_nobody() -> None:
    env = Heading(3, episode_steps=2, bound=9.0)
    _, reward, terminated, truncated, infos = begun(env).step(torch.ones(3, 3))
    assert truncated.all()
    assert not terminated.any()
    assert (env.clock == 1).all()  # ends after 2 and 4 steps
    first = replay(Heading(3, episode_steps=2, bound=9.0), [to_sphere(torch.ones(3, 3))[:, :2]] * 2)
    np.testing.assert_allclose(reward, (first[0][1] + first[1][1]) / 5)
    np.testing.assert_array_equal(infos["final_obs"]["state"], first[1][4]["final_obs"]["state"])


@pytest.mark.parametrize("make", [make_ase, make_calm, make_case])
def test_style_is_the_low_level_agents_own_and_the_agent_stays_as_it_is(make: Any, generator: torch.Generator) -> None:
    env = PointMass(N, skills=3, bound=0.45)
    low = make(env, generator)
    seed, latent = 3, sample_sphere(N, low.latent_dim, torch.Generator().manual_seed(8))
    before = {name: checkpoint_copy(part) for name, part in low.state_dict().items() if name != "latents"}
    drawn = generator.get_state()
    style = begun(env, low, seed).step(7 * latent)[4]["side_rewards"]["style"]
    assert torch.equal(drawn, generator.get_state())  # the mean action, under a given latent, without masks
    assert equal(before, {name: part for name, part in low.state_dict().items() if name != "latents"})

    twin = PointMass(N, skills=3, bound=0.45)
    obs, rollout = tensors(twin.reset(seed=seed)[0]), Rollout(5, N)
    low.follow(latent)
    going, counted = torch.ones(N, dtype=torch.bool), []
    for t in range(5):
        step = low.act(obs, deterministic=True)
        next_obs, _, terminated, truncated, infos = twin.step(step.action.numpy())
        successor = {f"next_{name}": value for name, value in true_next_obs(next_obs, infos).items()}
        rollout.store(t, {**step.extras, **successor})
        obs = tensors(next_obs)
        counted.append(going)
        going = going & ~torch.as_tensor(terminated | truncated)
    assert not going.all()
    own = low.rewards(rollout)["style"]
    torch.testing.assert_close(torch.from_numpy(style), (own * torch.stack(counted)).sum(0) / 5)
    assert style.std() > 1e-4


def checkpoint_copy(state: Any) -> Any:
    """The nested state with tensors of its own."""
    if isinstance(state, dict):
        return {name: checkpoint_copy(value) for name, value in state.items()}
    return state.clone() if isinstance(state, torch.Tensor) else state


def test_latents_lie_on_the_sphere_in_the_actions_direction(generator: torch.Generator) -> None:
    action = torch.tensor([[3.0, 0, 4], [1e-20, 0, 0], [0, -1e-4, 0], [0, 0, 0]])
    low = Compass()
    begun(Heading(4), low).step(action.numpy())
    on_sphere = low.seen[0][0]
    torch.testing.assert_close(on_sphere.norm(dim=-1), torch.ones(4))
    torch.testing.assert_close(on_sphere, torch.tensor([[0.6, 0, 0.8], [1, 0, 0], [0, -1, 0], [1, 0, 0]]))
    # from the origin all directions are alike: E z z^T = I / 3
    z = to_sphere(0.1 * torch.randn(40_000, 3, generator=generator))
    torch.testing.assert_close(z.T @ z / len(z), torch.eye(3) / 3, atol=0.01, rtol=0)
    assert SphereDecoder(3).space.shape == (3,)


def test_a_decoder_says_what_the_low_level_policy_sees() -> None:
    class Turn(SphereDecoder):
        def __call__(self, action: torch.Tensor) -> Command:
            return Command(to_sphere(action), {"skill": torch.ones(len(action), dtype=torch.int64)})

    low = Compass()
    obs, *_ = begun(Heading(4, skills=3), low, decoder=Turn(3)).step(torch.ones(4, 3))
    assert all((skill == 1).all() for _, skill in low.seen)
    assert (obs["skill"] != 1).any()  # what the environment commands is as it was


def test_a_term_of_the_latent_counts_with_the_steps_it_is_followed_for() -> None:
    asked = []

    def first_number(latent: torch.Tensor, obs: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
        asked.append(obs["goal"].clone())
        return {"first": latent[:, 0]}

    env = Heading(3, episode_steps=7, bound=9.0)
    latent_env = begun(env, latent_terms=first_number)
    goal = env.goal.copy()
    whole = latent_env.step(torch.tensor([[2.0, 0, 0]]).expand(3, 3))[4]["side_rewards"]["first"]
    np.testing.assert_allclose(whole, 1.0)
    part = latent_env.step(torch.tensor([[2.0, 0, 0]]).expand(3, 3))[4]["side_rewards"]["first"]
    np.testing.assert_allclose(part, 2 / 5)
    assert len(asked) == 2
    np.testing.assert_array_equal(asked[0], goal)
    np.testing.assert_array_equal(asked[1], goal)


def test_a_command_from_outside_reaches_the_next_step() -> None:
    env, low = Heading(2, skills=3), Compass()
    latent_env = begun(env, low)
    env.skill[:] = 2
    np.testing.assert_array_equal(latent_env.observation()["skill"], 2)
    latent_env.step(torch.ones(2, 3))
    assert (low.seen[0][1] == 2).all()


def test_without_terms_nothing_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    low = Compass()
    monkeypatch.setattr(low, "rewards", None)
    infos = begun(Heading(2), low, config=LatentEnvConfig(terms=())).step(torch.ones(2, 3))[4]
    assert infos["side_rewards"].keys() == {"speed"}


def test_state_goes_on_bit_for_bit(generator: torch.Generator, tmp_path: Path) -> None:
    """Also what the low-level agent draws, here for its style."""
    latent_env = begun(Heading(N, skills=3), Compass(noise=0.1))
    latents = torch.randn(6, N, 3, generator=generator)
    for latent in latents[:3]:
        latent_env.step(latent)
    checkpoint.save(tmp_path / "c", latent_env.state_dict())
    other = LatentEnv(Heading(N, skills=3), Compass(noise=0.1))
    other.load_state_dict(checkpoint.load(tmp_path / "c"))
    for latent in latents[3:]:
        (obs, *results, infos), (other_obs, *other_results, other_infos) = latent_env.step(latent), other.step(latent)
        assert all(np.array_equal(obs[name], other_obs[name]) for name in obs)
        assert all(np.array_equal(one, two) for one, two in zip(results, other_results, strict=True))
        assert np.array_equal(infos["side_rewards"]["style"], other_infos["side_rewards"]["style"])


def test_other_environments_are_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    env = Heading(2)
    env.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}
    with pytest.raises(AgentError, match=r"needs AutoresetMode\.SAME_STEP"):
        LatentEnv(env, Compass())
    monkeypatch.delattr(Heading, "state_dict")
    monkeypatch.delattr(PointMass, "state_dict")
    with pytest.raises(AgentError, match="has no state_dict"):
        LatentEnv(Heading(2), Compass())
    with pytest.raises(AgentError, match=r"latent_env\.steps=0"):
        LatentEnvConfig(steps=0)


def test_a_term_that_the_low_level_agent_has_not_is_refused_in_one_line() -> None:
    latent_env = begun(Heading(2), config=LatentEnvConfig(terms=("styl",)))
    with pytest.raises(
        AgentError, match=r"latent_env\.terms names styl; the low-level agent has style, other"
    ) as error:
        latent_env.step(torch.ones(2, 3))
    assert "\n" not in str(error.value)


# --- a policy of latents learns ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def low_level(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ASE after 50 iterations: its latents lead into all directions."""
    folder = tmp_path_factory.mktemp("low")
    make_runner(folder, num_envs=64, samples=64 * 8 * 50).run()
    return folder


def high_level(folder: Path, low_level: Path, iterations: int, seed: int = 0) -> Runner:
    generator = torch.Generator().manual_seed(seed)
    env = Heading(64, episode_steps=30, bound=9.0)
    low = make_ase(env, generator)
    saved = checkpoint.load(low_level)["agent"]
    low.load_state_dict({**saved, "latents": low.latents.state_dict()})
    latent_env = LatentEnv(env, low)
    config = RunnerConfig(
        samples=iterations * 64 * 8, horizon=8, gamma=0.9, lam=0.9, reward_weights=WEIGHTS | {"speed": 0}
    )
    return Runner(latent_env, make_task(latent_env, generator), config, generator, folder)


def test_a_task_agent_learns_to_direct_a_low_level_policy(low_level: Path, tmp_path: Path) -> None:
    runner = high_level(tmp_path, low_level, 30)
    history: list[dict[str, float]] = []
    runner.on_iteration = [history.append]
    generator = torch.Generator().manual_seed(1)
    runner.env.reset(seed=1)
    latents = sample_sphere(6 * 64, 4, generator).view(6, 64, 4)
    at_random = np.mean([runner.env.step(latent)[1].mean() for latent in latents])
    runner.run()
    learnt = np.mean([stats["reward/task"] for stats in history[-5:]])
    assert abs(at_random) < 0.1
    assert learnt > at_random + 0.25  # SPEED, 0.6, would be the low-level policy's best
    assert history[0]["reward/task"] < 0.15
    total = 0.9 * history[-1]["reward/task"] + 0.1 * history[-1]["reward/style"]
    assert history[-1]["reward/total"] == pytest.approx(total, rel=1e-4)


def test_n_and_n_more_iterations_are_2n_bit_for_bit(low_level: Path, tmp_path: Path) -> None:
    high_level(tmp_path / "whole", low_level, 4).run()
    high_level(tmp_path / "half", low_level, 2).run()
    second = high_level(tmp_path / "half", low_level, 4, seed=77)
    second.load(tmp_path / "half")
    second.run()
    assert equal(checkpoint.load(tmp_path / "whole"), checkpoint.load(tmp_path / "half"))


def test_a_decision_in_which_a_world_diverged_says_so() -> None:
    """In whichever of its steps; a world that was over before is a new episode's, and none of the decision's."""

    class Diverging(Heading):
        count = 0

        def step(self, actions: np.ndarray) -> tuple:
            obs, reward, terminated, truncated, infos = super().step(actions)
            self.count += 1
            healed = np.zeros(self.num_envs, bool)
            healed[1] = self.count == 2
            healed[2] = self.count == 5
            terminated = terminated | healed
            terminated[2] |= self.count == 3
            return obs, reward, terminated, truncated, infos | {"healed": healed}

    _, _, terminated, _, infos = begun(Diverging(4, bound=9.0)).step(torch.ones(4, 3).numpy())
    assert infos["healed"].tolist() == [False, True, False, False]
    assert terminated.tolist() == [False, True, True, False]
