"""What every metric owes: the order of trajectories, the numbers of clips, the threads and the heading do not matter.

One recording is disturbed in each of these ways, and every public function of `envs/metrics` is to say the same of it:
the same figures, or for rows and columns of trajectories and clips the same ones in the new order.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property

import pytest
import torch
from torch import Tensor

from murmillo.envs import metrics
from murmillo.envs.character import CONTROL_DT, Character, load_character
from murmillo.envs.metrics.alignment import warping_path
from murmillo.envs.metrics.classifier import (
    ClassifierConfig,
    confusion,
    controllability,
    inception_score,
    train_classifier,
)
from murmillo.envs.metrics.coverage import coverage, filtered_coverage, frequencies, majority_clip, positions
from murmillo.envs.metrics.diversity import average_pairwise_distance, most_diverse, repeated_distance, root_paths
from murmillo.envs.metrics.frechet import frechet_distance
from murmillo.envs.metrics.latents import class_distances, fisher_concentration
from murmillo.envs.metrics.maps import classical_mds
from murmillo.envs.metrics.nearest import ClipMatcher
from murmillo.envs.metrics.quality import foot_slide, jerk, power, residual_share
from murmillo.envs.metrics.recovery import recovery
from murmillo.envs.metrics.spread import Spread
from murmillo.envs.metrics.tasks import heading_cosine, imitation_error, normalised_return, reach_error
from murmillo.envs.metrics.transitions import source_and_destination, transition_coverage, transition_matrix
from murmillo.envs.metrics.windows import windows
from murmillo.envs.motion import MotionLibrary, load_clips
from murmillo.envs.observations import character_state
from murmillo.envs.rotations import quat_from_rotvec, quat_mul, quat_rotate

CLIPS, EACH, STEPS = 8, 8, 30
"""Clips, trajectories that begin in each, and control steps of a trajectory."""

ELSEWHERE = {
    "held_out_split": "divides one clip; tested with the classifier",
    "tsne": "a picture, which turns on the last bit of its input; its neighbourhoods and its seed are tested",
}
"""Public functions that are held to nothing here, and why."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A recording of n trajectories of T steps, and the K clips beside which it is put.

    Attributes:
        clips: states [F_c, D] of each clip.
        commanded: [n] int64 clip that each trajectory begins in; switch: [n] steps after which it goes on in another.
        qpos, qvel: [n, T + 1, ...] as MuJoCo has them; the world frame is in their first numbers alone.
        target_w: [n, T + 1, 3] [m]; direction_w: [n, T + 1, 3]; force_w: [n, T, J, 3] [N].
        touching: [n, T + 1, 2] bool; torque, velocity: [n, T, A]; reward: [n, T], 0 to 1.
        height: [n, T, 2] of root and head [m]; fallen: [n, T] bool.
    """

    character: Character
    clips: tuple[Tensor, ...]
    commanded: Tensor
    switch: Tensor
    qpos: Tensor
    qvel: Tensor
    target_w: Tensor
    direction_w: Tensor
    force_w: Tensor
    touching: Tensor
    torque: Tensor
    velocity: Tensor
    reward: Tensor
    height: Tensor
    fallen: Tensor

    @cached_property
    def state(self) -> Tensor:
        """[n, T + 1, D] float32."""
        return character_state(self.character, self.qpos, self.qvel, self.key_pos_w).float()

    @cached_property
    def key_pos_w(self) -> Tensor:
        return self.character.key_positions(self.qpos)

    @cached_property
    def foot_pos_w(self) -> Tensor:
        names = self.character.key_bodies
        return self.key_pos_w[:, :, [names.index(foot) for foot in self.character.feet]]

    @cached_property
    def matcher(self) -> ClipMatcher:
        return ClipMatcher(self.clips)

    @cached_property
    def nearest(self) -> Tensor:
        return self.matcher.nearest(self.state)

    @cached_property
    def parts(self) -> tuple[Tensor, Tensor]:
        """Clips before and after the switch."""
        return source_and_destination(self.nearest, self.switch, CLIPS)

    @cached_property
    def latent(self) -> Tensor:
        """[n, 5] of each trajectory, as an encoder that does not know the clips may give them."""
        generator = torch.Generator().manual_seed(5)
        return self.state.double().mean(1) @ torch.randn(self.state.shape[-1], 5, generator=generator).double()

    @cached_property
    def probability(self) -> Tensor:
        """[n, K] of the clips, by how far their means are."""
        means = torch.stack([clip.mean(0) for clip in self.clips])
        return (-torch.cdist(self.state[:, :10].mean(1), means)).softmax(1)

    @property
    def of_skills(self) -> Tensor:
        """[K, EACH, T + 1, D] the motions that begin in each clip."""
        return torch.stack([self.state[self.commanded == clip] for clip in range(CLIPS)])

    def with_trajectories(self, rows: Tensor) -> "Scene":
        """The same recording with its trajectories in another order."""
        series = {f.name: value for f in fields(self) if isinstance(value := getattr(self, f.name), Tensor)}
        return replace(self, **{name: value[rows] for name, value in series.items()})

    def with_clips(self, order: Tensor) -> "Scene":
        """The same recording where clip order[i] has the number i."""
        clips = tuple(self.clips[clip] for clip in order.tolist())
        return replace(self, clips=clips, commanded=order.argsort()[self.commanded])

    def seen_from(self, angle: Tensor, place: Tensor) -> "Scene":
        """The same recording with each trajectory turned by angle [n] [rad] and moved by place [n, 3] [m]."""
        turn = quat_from_rotvec(angle[:, None] * torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))[:, None]
        qpos, qvel = self.qpos.clone(), self.qvel.clone()
        qpos[..., :3] = quat_rotate(turn, self.qpos[..., :3]) + place[:, None]
        qpos[..., 3:7] = quat_mul(turn, self.qpos[..., 3:7])
        qvel[..., :3] = quat_rotate(turn, self.qvel[..., :3])  # the angular velocity is in the root's own frame
        return replace(
            self,
            qpos=qpos,
            qvel=qvel,
            target_w=quat_rotate(turn, self.target_w) + place[:, None],
            direction_w=quat_rotate(turn, self.direction_w),
            force_w=quat_rotate(turn[:, None], self.force_w),
        )


@dataclass(frozen=True)
class Case:
    """A metric of a scene.

    Attributes:
        measure: its figures, [...].
        axes: what lies along the first ones of them: "trajectory", "clip" or "".
        clips: the figures are numbers of clips.
        ordered: the order of trajectories and clips does not matter; why it may is beside the case.
        seen: something that it measures is seen in the world or is a feature of what is.
    """

    measure: Callable[[Scene], Tensor]
    axes: tuple[str, ...] = ()
    clips: bool = False
    ordered: bool = True
    seen: bool = True


def figures(*values: float | Spread) -> Tensor:
    numbers = [(v.mean, v.deviation) if isinstance(v, Spread) else (v,) for v in values]
    return torch.tensor([number for some in numbers for number in some], dtype=torch.float64)


def classifier(scene: Scene) -> Tensor:
    config = ClassifierConfig(frames=5, hidden=32, steps=60, batch=64)
    found = train_classifier(scene.clips, torch.Generator().manual_seed(0), config=config)
    return torch.cat([figures(found.held_out_accuracy), found.probabilities(scene.state[:, :5]).double().flatten()])


def recovered(scene: Scene) -> Tensor:
    found = recovery(scene.height[..., 0], scene.height[..., 1], scene.fallen)
    assert found.fell > len(found.time_s) > 0
    return figures(found.trials, found.fell, found.standing, found.share, found.mean_s, found.max_s)


def imitated(scene: Scene) -> Tensor:
    """Of each trajectory: its key points beside its target, as if they were all to be there."""
    pos = scene.key_pos_w[:, ::5]
    pairs = zip(pos, scene.target_w[:, ::5, None].expand_as(pos), strict=True)
    return torch.stack([figures(imitation_error(p, r), imitation_error(p, r, align=False)) for p, r in pairs])


def warped(scene: Scene) -> Tensor:
    """Of each trajectory: the cost of its path beside itself a third faster."""
    costs = [torch.cdist(state[::3], state[::5]) for state in scene.state.double()]
    return torch.stack([cost[warping_path(cost)].sum() for cost in costs])


CASES = {
    "ClipMatcher": Case(lambda s: ClipMatcher(s.clips).nearest(s.state), ("trajectory",), clips=True),
    "average_pairwise_distance": Case(lambda s: figures(average_pairwise_distance(s.state))),
    "class_distances": Case(lambda s: class_distances(s.latent, s.commanded), ("clip", "clip")),
    "classical_mds": Case(lambda s: classical_mds(torch.cdist(s.latent, s.latent)), ("trajectory",)),
    "confusion": Case(lambda s: confusion(s.probability, s.commanded, CLIPS), ("clip", "clip")),
    "controllability": Case(lambda s: figures(controllability(s.probability, s.commanded))),
    "coverage": Case(lambda s: figures(coverage(s.parts[0], s.matcher.distinct))),
    "filtered_coverage": Case(lambda s: figures(filtered_coverage(s.parts[0], s.matcher.distinct, 0.9))),
    "fisher_concentration": Case(lambda s: figures(fisher_concentration(s.latent, s.commanded))),
    "foot_slide": Case(lambda s: figures(foot_slide(s.foot_pos_w, s.touching))),
    "frechet_distance": Case(
        lambda s: figures(*(frechet_distance(s.state[:, :f], windows(s.clips, f, hop=7)) for f in (1, 2, 5)))
    ),
    "frequencies": Case(lambda s: frequencies(s.parts[0], s.matcher.distinct), ("clip",)),
    "heading_cosine": Case(lambda s: figures(heading_cosine(s.qvel[..., :3], s.direction_w))),
    "imitation_error": Case(imitated, ("trajectory",)),
    "inception_score": Case(lambda s: figures(inception_score(s.probability))),
    "jerk": Case(lambda s: figures(jerk(s.key_pos_w))),
    "majority_clip": Case(lambda s: majority_clip(s.nearest, CLIPS), ("trajectory",), clips=True),
    "most_diverse": Case(lambda s: most_diverse(s.of_skills, CLIPS), clips=True),
    "normalised_return": Case(lambda s: figures(normalised_return(s.reward, 0.0, 1.0)), seen=False),
    "positions": Case(lambda s: positions(s.parts[0], s.matcher.distinct), ("trajectory",), clips=True),
    "power": Case(lambda s: figures(power(s.torque, s.velocity)), seen=False),
    "reach_error": Case(lambda s: figures(reach_error(s.key_pos_w[:, :, -1], s.target_w))),
    "recovery": Case(recovered, seen=False),
    # its draws are of places in the order
    "repeated_distance": Case(
        lambda s: figures(repeated_distance(s.state, EACH, CLIPS, torch.Generator().manual_seed(0))), ordered=False
    ),
    "residual_share": Case(
        lambda s: figures(residual_share(s.force_w, s.torque, [j.action for j in s.character.joints]))
    ),
    "root_paths": Case(lambda s: root_paths(s.qpos[..., :3], s.qpos[..., 3:7]), ("trajectory",)),
    "source_and_destination": Case(
        lambda s: torch.stack(source_and_destination(s.nearest, s.switch, CLIPS)), ("", "trajectory"), clips=True
    ),
    # draws a stretch of each clip in turn; of what is seen it knows the clips alone
    "train_classifier": Case(classifier, ordered=False, seen=False),
    "transition_coverage": Case(lambda s: figures(transition_coverage(*s.parts, s.matcher.distinct))),
    "transition_matrix": Case(lambda s: transition_matrix(*s.parts, s.matcher.distinct), ("clip", "clip")),
    "warping_path": Case(warped, ("trajectory",)),
    "windows": Case(lambda s: windows(list(s.state), STEPS + 1), ("trajectory",)),
}


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Trajectories whose clips need no lot: of clips with as many transitions the lower number would win."""
    whole = recorded(2 * EACH)
    kept = [((whole.commanded == clip) & decided(whole)).nonzero().flatten()[:EACH] for clip in range(CLIPS)]
    return whole.with_trajectories(torch.stack(kept, dim=1).flatten())


def decided(scene: Scene) -> Tensor:
    """[n] bool: before the switch, behind it and in all, one clip alone has the most transitions."""
    before = torch.arange(STEPS) < scene.switch[:, None]
    votes = torch.nn.functional.one_hot(scene.nearest, CLIPS)
    counts = [(votes * counted[..., None]).sum(1) for counted in (before, ~before, torch.ones_like(before))]
    return torch.stack([count.topk(2).values.diff()[:, 0] < 0 for count in counts]).all(0)


def recorded(each: int) -> Scene:
    """Clips followed and left for others on the way, with noise on the velocities so that no match is at distance 0."""
    character, generator = load_character(), torch.Generator().manual_seed(0)
    chosen = load_clips("builtin", character)[::6][:CLIPS]
    library = MotionLibrary(chosen, character)
    n = CLIPS * each

    def normal(*shape: int) -> Tensor:
        return torch.randn(n, *shape, generator=generator, dtype=torch.float64)

    def uniform(*shape: int) -> Tensor:
        return torch.rand(n, *shape, generator=generator, dtype=torch.float64)

    first, second = torch.arange(n) % CLIPS, torch.randint(CLIPS, (n,), generator=generator)
    switch = torch.randint(12, 18, (n,), generator=generator)
    step = torch.arange(STEPS + 1)
    clip = torch.where(step <= switch[:, None], first[:, None], second[:, None])
    begin = uniform() * (library.duration.amin() - STEPS * CONTROL_DT)
    assert (begin > 0).all()
    qpos, qvel = library.pose(clip.flatten(), (begin[:, None] + CONTROL_DT * step).flatten())
    qpos, qvel = (values.double().unflatten(0, (n, STEPS + 1)) for values in (qpos, qvel))
    times = [torch.arange(STEPS, int(duration / CONTROL_DT)) * CONTROL_DT for duration in library.duration.tolist()]
    clips = [library.window(torch.full((len(some),), c), some.double(), 1)[:, 0] for c, some in enumerate(times)]
    axes = len(character.action_offset)
    return Scene(
        character=character,
        clips=tuple(clips),
        commanded=first,
        switch=switch,
        qpos=qpos,
        qvel=qvel + 0.5 * normal(*qvel.shape[1:]),
        target_w=qpos[..., :3] + normal(STEPS + 1, 3),
        direction_w=normal(1, 3).expand(-1, STEPS + 1, -1),
        force_w=normal(STEPS, len(character.joints), 3),
        touching=uniform(STEPS + 1, 2) < 0.7,
        torque=normal(STEPS, axes),
        velocity=normal(STEPS, axes),
        reward=uniform(STEPS),
        height=torch.tensor([0.4, 0.9]).double() + 0.4 * uniform(1, 1) * uniform(STEPS, 1),
        fallen=uniform(STEPS) < 0.05,
    )


@pytest.fixture(scope="module")
def rows() -> Tensor:
    return torch.randperm(CLIPS * EACH, generator=torch.Generator().manual_seed(1))


@pytest.fixture(scope="module")
def order() -> Tensor:
    """In which no clip keeps its number."""
    return (5 * torch.arange(CLIPS) + 3) % CLIPS


@pytest.fixture(scope="module")
def reordered(scene: Scene, rows: Tensor) -> Scene:
    return scene.with_trajectories(rows)


@pytest.fixture(scope="module")
def renumbered(scene: Scene, order: Tensor) -> Scene:
    return scene.with_clips(order)


@pytest.fixture(scope="module")
def turned(scene: Scene) -> Scene:
    generator = torch.Generator().manual_seed(3)
    angle = 2.0 * torch.pi * torch.rand(CLIPS * EACH, generator=generator, dtype=torch.float64)
    place = 3.0 * torch.randn(CLIPS * EACH, 3, generator=generator, dtype=torch.float64)
    place[:, 2] = 0.0
    return scene.seen_from(angle, place)


@pytest.fixture
def threads() -> Iterator[Callable[[int], None]]:
    before = torch.get_num_threads()
    yield torch.set_num_threads
    torch.set_num_threads(before)


def named(chosen: Callable[[Case], bool]) -> list[str]:
    return [name for name, case in CASES.items() if chosen(case)]


def in_new_order(result: Tensor, case: Case, kind: str, order: Tensor) -> Tensor:
    """What was found, with the rows and columns of trajectories or of clips in another order."""
    for axis, along in enumerate(case.axes):
        if along == kind:
            result = result.index_select(axis, order)
    return order.argsort()[result] if case.clips and kind == "clip" else result


def test_every_metric_is_here() -> None:
    modules = [importlib.import_module(f"{metrics.__name__}.{m.name}") for m in pkgutil.iter_modules(metrics.__path__)]
    public = {
        name
        for module in modules
        for name, value in vars(module).items()
        if inspect.isfunction(value) and value.__module__ == module.__name__ and not name.startswith("_")
    }
    assert public == (CASES.keys() - {"ClipMatcher"}) | ELSEWHERE.keys()


def test_the_scene_has_something_to_measure(scene: Scene) -> None:
    """What is empty, full or the same everywhere would stay so whatever a metric does wrong."""
    assert (frequencies(scene.parts[0], range(CLIPS)) > 0).sum() > CLIPS // 2
    assert len(scene.parts[0].unique()) > 1
    assert 0.0 < filtered_coverage(scene.parts[0], range(CLIPS), 0.9) < 1.0
    assert 0.0 < transition_coverage(*scene.parts, range(CLIPS)) < 1.0
    assert 1 / CLIPS < controllability(scene.probability, scene.commanded) < 1.0


@pytest.mark.parametrize("name", named(lambda case: case.ordered))
def test_the_order_of_trajectories_does_not_matter(name: str, scene: Scene, reordered: Scene, rows: Tensor) -> None:
    case = CASES[name]
    expected = in_new_order(case.measure(scene), case, "trajectory", rows)
    torch.testing.assert_close(case.measure(reordered), expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", named(lambda case: case.ordered))
def test_the_numbers_of_clips_do_not_matter(name: str, scene: Scene, renumbered: Scene, order: Tensor) -> None:
    case = CASES[name]
    expected = in_new_order(case.measure(scene), case, "clip", order)
    torch.testing.assert_close(case.measure(renumbered), expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_the_number_of_threads_does_not_matter(name: str, scene: Scene, threads: Callable[[int], None]) -> None:
    threads(1)
    alone = CASES[name].measure(scene)
    threads(3)
    torch.testing.assert_close(CASES[name].measure(scene), alone, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", named(lambda case: case.seen))
def test_place_and_heading_do_not_matter(name: str, scene: Scene, turned: Scene) -> None:
    """To the rounding of float32 states, which the square root of a distance near 0 makes larger."""
    torch.testing.assert_close(CASES[name].measure(turned), CASES[name].measure(scene), rtol=1e-4, atol=1e-4)
