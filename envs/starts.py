"""How episodes begin: in a clip, in the default pose, fallen, or where the last one fell (ASE section 6.5)."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.devices import on
from murmillo.envs.errors import SuiteError
from murmillo.envs.geometry import lowest_point
from murmillo.envs.moments import StartingMoments
from murmillo.envs.motion import MotionLibrary
from murmillo.envs.physics import make_physics

REFERENCE, DEFAULT, FALLEN, RECOVERY = range(4)
KINDS = ("reference", "default", "fallen", "recovery")

_MOST_AHEAD = 512
_STOCKED = ("qpos", "qvel", "frames", "clip", "time")
_NOWHERE = -1


@dataclass
class StartConfig:
    """Shares of the starts, as in the published code of ASE, and of those whose label is known beforehand.

    Attributes:
        recovery: of the episodes that ended by a fall, the share that goes on from where it lies.
        fallen: of the other episodes, the share that begins in a fallen state.
        reference: of the rest, the share that begins in a clip; the others begin in the default pose.
        commanded: of those that begin in a clip, the share that is commanded the clip's label; all others are commanded
            any (C·ASE, appendix A.4.2), so that of K labels each is begun in its own clips in a share of 1 / K only.
        adaptive: of those that begin in a clip, the share that begins where late episodes fell (`StartingMoments`).
        free_steps: steps in which a recovery or fallen start may lie on the ground (60 steps are 2 s).
        default_height: height of the pelvis in the default pose [m]; with other legs it is higher or lower by as much.
        drop_height: fallen states are dropped from heights of this range [m] (the paper names no range), with other
            legs from as much higher or lower.
        fallen_states: most fallen states that are made; fewer for few worlds.
    """

    recovery: float = 0.2
    fallen: float = 0.1
    reference: float = 0.5
    commanded: float = 0.0
    adaptive: float = 0.0
    free_steps: int = 60
    default_height: float = 0.89
    drop_height: tuple[float, float] = (0.89, 1.4)
    fallen_states: int = 256


@dataclass(frozen=True)
class Starts:
    """Where n worlds begin; rows of a recovery are not used.

    Attributes:
        kind: [n] REFERENCE, DEFAULT, FALLEN or RECOVERY.
        qpos: [n, nq]; qvel: [n, nv].
        frames: [r, W, D] the frames of the clips up to the r reference starts (`Features.recorded`).
        clip, time: [r] int64 and float64 [s], the moments of these starts.
        skill: [r] int64 the labels of these clips.
        commanded: [r] bool, true where that is the label to command.
    """

    kind: Tensor
    qpos: Tensor
    qvel: Tensor
    frames: Tensor
    clip: Tensor
    time: Tensor
    skill: Tensor
    commanded: Tensor


class StartSampler:
    """Draws starts by the shares of `StartConfig`; the library's clips are those of `Character.base`."""

    def __init__(
        self,
        character: Character,
        library: MotionLibrary,
        config: StartConfig,
        num_envs: int,
        frames: int,
        threads: int = 0,
    ) -> None:
        """`frames` come with each reference start; `threads` of the physics for the fallen states, 0 for every CPU."""
        for name in ("recovery", "fallen", "reference", "commanded", "adaptive"):
            if not 0.0 <= getattr(config, name) <= 1.0:
                raise SuiteError(f"starts.{name}={getattr(config, name)}: needs a share between 0 and 1")
        if config.fallen_states < 1:
            raise SuiteError(f"starts.fallen_states={config.fallen_states}: needs at least 1")
        self.config = config
        self._character, self._threads = character, threads
        self._moments = StartingMoments(library, config.adaptive)
        self._references = _ReferenceStock(character, library, self._moments, min(num_envs, _MOST_AHEAD), frames)
        self._clip_skill = library.clip_skill
        self._begun = torch.full((num_envs,), _NOWHERE, device=library.device)
        """[N] int64 stretch of the clips that each episode began in."""
        self._pool_size = min(config.fallen_states, max(16, num_envs))
        self._pool: Tensor | None = None
        self.on_ground = True
        """Whether episodes may begin on the ground: fallen, or where the last one fell."""
        self._default = character.default_qpos.clone().to(torch.get_default_device())
        self._grown = (character.default_qpos[2] - character.base.default_qpos[2]).item()
        self._default[2] = config.default_height + self._grown

    def draw(self, env_ids: Tensor, fell: Tensor, generator: torch.Generator, kind: int | None = None) -> Starts:
        """Starts of the worlds env_ids [n]; fell [n] bool says whose last episode ended by a fall.

        `kind` makes all of one kind.
        """
        n, config = len(fell), self.config
        chance = torch.rand(3, n, generator=generator)
        kinds = torch.where(chance[0] < config.reference, REFERENCE, DEFAULT)
        if self.on_ground:
            kinds = torch.where(chance[1] < config.fallen, FALLEN, kinds)
            kinds = torch.where(fell & (chance[2] < config.recovery), RECOVERY, kinds)
        if kind is not None:
            kinds.fill_(kind)
        qpos = self._default.repeat(n, 1)
        qvel = torch.zeros(n, self._character.model.nv, dtype=torch.float64)
        moving = (kinds == REFERENCE).nonzero().squeeze(-1)
        qpos[moving], qvel[moving], frames, clip, time = self._references.take(len(moving), generator)
        self._begun[env_ids] = _NOWHERE
        self._begun[env_ids[moving]] = self._moments.stretch(clip, time)
        commanded = torch.zeros(len(moving), dtype=torch.bool)
        if config.commanded:
            commanded = torch.rand(len(moving), generator=generator) < config.commanded
        fallen = (kinds == FALLEN).nonzero().squeeze(-1)
        if len(fallen):
            pool = self._fallen_states()
            qpos[fallen] = pool[torch.randint(len(pool), (len(fallen),), generator=generator)]
        return Starts(kinds, qpos, qvel, frames, clip, time, self._clip_skill[clip], commanded)

    def note(self, env_ids: Tensor, failed: Tensor) -> None:
        """The episodes of the worlds env_ids [n] are over, by a fall or the like where failed [n] bool."""
        if self.config.adaptive:
            begun = self._begun[env_ids]
            known = begun != _NOWHERE
            self._moments.note(begun[known], failed[known])

    def moved(self, starts: Starts, by: Tensor) -> Starts:
        """The starts as they are elsewhere by [n, 3] [m]."""
        qpos = starts.qpos.clone()
        qpos[:, :3] += by
        frames = self._references.moved(starts.frames, by[starts.kind == REFERENCE])
        return replace(starts, qpos=qpos, frames=frames)

    def forget(self) -> None:
        """Throw away what was drawn ahead and what was learned of falls, as a new seed asks."""
        self._references.stock = None
        self._moments.falls = torch.ones_like(self._moments.falls)
        self._begun.fill_(_NOWHERE)

    def state_dict(self) -> dict[str, Tensor]:
        """What was drawn ahead, where episodes began, and where they fell."""
        stock = dict(zip(_STOCKED, self._references.stock or (), strict=False))
        return {**stock, "falls": self._moments.falls.clone(), "begun": self._begun.clone()}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        stocked = _STOCKED[0] in state
        self._references.stock = tuple(state[name].clone() for name in _STOCKED) if stocked else None
        self._moments.falls, self._begun = state["falls"].clone(), state["begun"].clone()

    def _fallen_states(self) -> Tensor:
        """[P, nq] `_drop`, made once."""
        if self._pool is None:
            device = self._default.device
            with on(torch.device("cpu")):
                self._pool = self._drop(self._default.cpu()).to(device)
        return self._pool

    def _drop(self, default: Tensor) -> Tensor:
        """[P, nq] poses of characters that were dropped 2.5 s ago, turned at random, with a random constant action.

        They come from a generator of their own and from MuJoCo on the CPU, so that they are the same in every run.
        """
        generator, n = torch.Generator().manual_seed(0), self._pool_size
        physics = make_physics(self._character, n, threads=self._threads)
        qpos = default.repeat(n, 1)
        low, high = self.config.drop_height
        qpos[:, 2] = self._grown + low + (high - low) * torch.rand(n, generator=generator, dtype=torch.float64)
        orientation = torch.randn(n, 4, generator=generator, dtype=torch.float64)
        qpos[:, 3:7] = orientation / orientation.norm(dim=-1, keepdim=True)
        physics.write(torch.arange(n), qpos, torch.zeros_like(physics.state.qvel))
        action = torch.rand(n, self._character.action_dim, generator=generator, dtype=torch.float64) - 0.5
        target = self._character.targets(action)
        for _ in range(75):
            physics.step(target)
        return physics.state.qpos.clone()


class _ReferenceStock:
    """Reference starts, made many at a time: a hundred cost little more than one."""

    def __init__(
        self, character: Character, library: MotionLibrary, moments: StartingMoments, batch: int, frames: int
    ) -> None:
        self._character, self._library, self._moments = character, library, moments
        self._batch, self._frames = batch, frames
        self.stock: tuple[Tensor, ...] | None = None
        """What is left of qpos [m, nq], qvel [m, nv], frames [m, W, D], clip and time [m]."""

    def take(self, n: int, generator: torch.Generator) -> tuple[Tensor, ...]:
        """qpos [n, nq], qvel [n, nv], frames [n, W, D], clip and time [n] of n starts."""
        left = 0 if self.stock is None else len(self.stock[0])
        if self.stock is None or left < n:
            made = self._make(max(self._batch, n - left), generator)
            self.stock = made if self.stock is None else tuple(map(torch.cat, zip(self.stock, made, strict=True)))
        taken = tuple(field[:n] for field in self.stock)
        self.stock = tuple(field[n:] for field in self.stock)
        return taken

    def _make(self, n: int, generator: torch.Generator) -> tuple[Tensor, ...]:
        clip, time = self._moments.draw(n, generator)
        qpos, qvel = self._character.from_base(*self._library.pose(clip, time))
        # lifted out of the floor, which would throw them into the air
        lift = (-lowest_point(self._character, qpos)).clamp_min(0.0)
        qpos[:, 2] += lift
        frames = self._library.frames(clip, time, self._frames)
        rise = torch.nn.functional.pad(lift.unsqueeze(-1), (2, 0))
        return qpos.double(), qvel.double(), self.moved(frames, rise), clip, time

    def moved(self, frames: Tensor, by: Tensor) -> Tensor:
        """Frames [n, W, D] of the clips, elsewhere by [n, 3] [m]."""
        return self._library.features.moved(frames, by)
