"""Commands, recordings and replays, on the built-in clips and a policy that stands still."""

from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from torch import Tensor

from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation.chunks import ChunkStore
from murmillo.cli.evaluation.commands import Commander
from murmillo.cli.evaluation.digests import digest
from murmillo.cli.evaluation.gathering import collect, gather
from murmillo.cli.evaluation.protocols import HELD, PUSHED, SWITCHED, WINDOW, Protocol
from murmillo.cli.evaluation.recording import Player
from murmillo.cli.evaluation.replay import Replayer
from murmillo.cli.evaluation.scene import Evidence, Scene
from murmillo.cli.evaluation.sources import REPLAYED
from murmillo.cli.evaluation.table import METRICS
from murmillo.envs import EnvConfig, HumanoidVectorEnv
from murmillo.envs.character import Character, load_character
from murmillo.envs.motion import MotionLibrary, load_clips


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


@pytest.fixture(scope="module")
def library(character: Character) -> MotionLibrary:
    return MotionLibrary(load_clips("builtin", character), character)


@pytest.fixture(scope="module")
def scene(character: Character, library: MotionLibrary) -> Scene:
    return Scene(character, library, seed=1, labelled=True)


@pytest.fixture(scope="module")
def replayer(scene: Scene) -> Replayer:
    return Replayer(scene.character, scene.library, scene.states)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def no_tick(steps: int) -> None:
    pass


def test_replayed_clips_cover_themselves(scene: Scene, replayer: Replayer, tmp_path: Path) -> None:
    """The upper bound of the metrics: 100 % coverage at every rate, and nearer to the clips than what is not they."""
    clips = len(scene.library.clips)
    store = ChunkStore(tmp_path, clips, {})
    gather(store, {REPLAYED: replayer}, [HELD], clips, 1, scene)
    held, diverged = collect(store, REPLAYED, HELD, clips)
    assert diverged == 0
    assert held["matched"].tolist() == list(range(clips))
    evidence = Evidence(scene, REPLAYED, None, {HELD.name: held})
    coverage = METRICS["coverage"].judge(evidence)
    assert coverage is not None
    assert {name: value.value for name, value in coverage.values.items()} == dict.fromkeys(coverage.values, 1.0)
    assert coverage.curves["frequencies"] == [1] * clips
    frechet = METRICS["frechet"].judge(evidence)
    turned = METRICS["frechet"].judge(
        Evidence(scene, REPLAYED, None, {HELD.name: {**held, "window": held["window"] + 0.3}})
    )
    assert frechet is not None
    assert turned is not None
    # a shift of 0.3 in each of 120 features is 120 x 0.09 in the mean
    moved = turned.values["frechet_1"].value - frechet.values["frechet_1"].value
    assert moved == pytest.approx(120 * 0.09, rel=0.5)


def test_a_replayed_window_lies_within_its_clip(scene: Scene, replayer: Replayer) -> None:
    numbers = torch.arange(len(scene.library.clips))
    recording = replayer.record(HELD, numbers, generator(), no_tick)
    window = digest(recording, HELD, scene.matcher, len(numbers))["window"]
    for states, seen in zip(scene.states, window, strict=True):
        if len(states) >= WINDOW:
            first = (states == seen[0]).all(1).nonzero().flatten()
            assert any(torch.equal(states[frame : frame + WINDOW], seen) for frame in first.tolist())


def test_a_replayed_root_goes_on_where_its_clip_ends(scene: Scene, replayer: Replayer) -> None:
    recording = replayer.record(HELD, torch.arange(len(scene.library.clips)), generator(), no_tick)
    steps = recording.root_pos_w[..., :2].diff(dim=1).norm(dim=-1)
    fastest = max(states[:, 7:9].norm(dim=1).max().item() for states in scene.states)
    assert steps.max() * 30.0 < 1.5 * fastest
    assert recording.root_pos_w[:, -1, :2].norm(dim=-1).max() > 5.0  # and does not jump back to the start


def test_a_replay_switches_clips(scene: Scene, replayer: Replayer) -> None:
    clips = len(scene.library.clips)
    recording = replayer.record(SWITCHED, torch.arange(clips), generator(), no_tick)
    pairs = digest(recording, SWITCHED, scene.matcher, clips)
    assert pairs["source"].tolist() == list(range(clips))
    assert pairs["destination"].tolist() != pairs["source"].tolist()
    for clip, states in zip(pairs["destination"].tolist(), recording.state, strict=True):
        assert torch.equal(states[201], scene.states[clip][0])


class Standing:
    """Holds the default pose, and writes down what it is told."""

    def __init__(self, worlds: int) -> None:
        self.generator = torch.Generator()
        self.worlds = worlds
        self.followed: list[Tensor] = []
        self.skills: list[Tensor] = []

    def draw_latents(self, n: int) -> Tensor:
        return torch.rand(n, 2, generator=self.generator)

    def follow(self, latent: Tensor) -> None:
        self.latent = latent

    def reset(self, env_ids: Tensor) -> None:
        self.latent = torch.full((self.worlds, 2), torch.nan)

    def act(self, obs: dict[str, Tensor], *, deterministic: bool) -> SimpleNamespace:
        assert deterministic
        self.followed.append(self.latent)
        self.skills.append(obs["skill"])
        return SimpleNamespace(action=torch.zeros(self.worlds, 31))


@pytest.fixture(scope="module")
def env() -> HumanoidVectorEnv:
    return HumanoidVectorEnv(4, EnvConfig(autoreset="disabled", episode_steps=1000, threads=1))


def test_commands_change_world_by_world(env: HumanoidVectorEnv) -> None:
    agent, protocol = Standing(4), Protocol("switched", "", steps=12, switch=(3, 9))
    player = Player(env, agent, Commander(env.library, labelled=True, encodes=False), "default")
    recording = player.record(protocol, torch.arange(7, 11), generator(), no_tick)
    assert recording.command.skill is not None
    assert recording.command.skill.tolist() == [7, 8, 9, 10]
    assert len(recording.switch.unique()) > 1
    followed, skills = torch.stack(agent.followed, 1), torch.stack(agent.skills, 1)
    for world, switch in enumerate(recording.switch.tolist()):
        assert (followed[world, :switch] == recording.command.latent[world]).all()
        assert (followed[world, switch:] == followed[world, -1]).all()
        assert (followed[world, -1] != recording.command.latent[world]).all()
        assert (skills[world, :switch] == 7 + world).all()
        assert len(skills[world, switch:].unique()) == 1
    assert recording.state.shape == (4, 13, 120)
    assert (recording.state[:, 0] == recording.state[0, 0]).all()  # all begin in the same pose


def test_a_recording_depends_on_its_generator_alone(env: HumanoidVectorEnv) -> None:
    player = Player(env, Standing(4), Commander(env.library, labelled=False, encodes=False), "reference")
    protocol = Protocol("held", "", steps=35)
    a, other, b = (player.record(protocol, torch.arange(4), generator(seed), no_tick) for seed in (1, 2, 1))
    for name in ("state", "root_pos_w", "torque", "touching", "cut"):
        assert torch.equal(getattr(a, name), getattr(b, name)), name
    assert not torch.equal(a.state, other.state)


def test_a_push_throws_the_character_over(env: HumanoidVectorEnv, scene: Scene) -> None:
    player = Player(env, Standing(4), Commander(env.library, labelled=False, encodes=False), "default")
    push = Protocol(PUSHED.name, "", steps=40, push=(10, 25))
    pushed = player.record(push, torch.arange(4), generator(), no_tick)
    calm = player.record(Protocol("held", "", steps=40), torch.arange(4), generator(), no_tick)
    assert torch.equal(pushed.state[:, :11], calm.state[:, :11])
    moved = (pushed.root_pos_w - calm.root_pos_w)[..., :2].norm(dim=-1)
    assert moved[:, 25].min() > 0.3
    kept = digest(pushed, push, scene.matcher, len(scene.library.clips))
    assert kept["root_height"].shape == kept["fallen"].shape == (4, 30)
    assert torch.equal(kept["root_height"][:, 0], pushed.root_pos_w[:, 11, 2])


def test_trajectories_that_diverged_are_left_out_and_not_all_may() -> None:
    store = SimpleNamespace(size=3)
    store.load = lambda *_: {"healed": torch.tensor([False, True, False]), "value": torch.tensor([1.0, 2.0, 3.0])}
    digests, left_out = collect(store, REPLAYED, HELD, 3)  # type: ignore[arg-type]
    assert digests["value"].tolist() == [1.0, 3.0]
    assert left_out == 1
    store.load = lambda *_: {"healed": torch.ones(3, dtype=torch.bool), "value": torch.zeros(3)}
    with pytest.raises(CommandError, match="diverged in every one of clips replayed, held"):
        collect(store, REPLAYED, HELD, 3)  # type: ignore[arg-type]
