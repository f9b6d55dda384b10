"""A library of clips as tensors: sampling, poses at any time, and windows of features for discriminators."""

from collections.abc import Sequence
from difflib import get_close_matches
from itertools import accumulate

import torch
from torch import Tensor

from murmillo.envs.character import CONTROL_DT, Character
from murmillo.envs.errors import MotionError
from murmillo.envs.features import CharacterFeatures, Features
from murmillo.envs.motion.clip import Clip, check_clip
from murmillo.envs.motion.velocities import clip_velocities
from murmillo.envs.rotations import slerp

_ON_FRAME = 1e-4
"""[frames] A time this near to a frame is the frame's: times that went through float32 would else miss it."""


class MotionLibrary:
    """The clips of one character, flattened into frame tensors.

    Attributes:
        clips: the C clips, checked.
        skills: the labels, sorted, each once.
        clip_skill: [C] int64 index into `skills`.
        weight: [C] float64 sampling weights, as the clips have them.
        duration: [C] float64 [s].
        mask: [C, D] bool, true where the clip says nothing of a feature of a window; None where all say everything.
        features: the form of windows.
    """

    def __init__(
        self,
        clips: Sequence[Clip],
        character: Character,
        device: str | torch.device = "cpu",
        features: Features | None = None,
    ) -> None:
        """`features` are those of `character`; without, the papers' state (`CharacterFeatures`)."""
        if not clips:
            raise MotionError("a motion library needs at least one clip; there is none")
        self.character = character
        self.features = features or CharacterFeatures(character)
        self.device = torch.device(device)
        self.clips = tuple(check_clip(clip, character) for clip in clips)
        self.skills = tuple(sorted({clip.label for clip in clips}))
        self.clip_skill = torch.tensor([self.skills.index(clip.label) for clip in clips], device=self.device)
        self.weight = torch.tensor([clip.weight for clip in clips], dtype=torch.float64, device=self.device)
        self.duration = torch.tensor([clip.duration for clip in clips], dtype=torch.float64, device=self.device)
        masks = torch.stack([self.features.mask(clip.masked) for clip in self.clips])
        self.mask = masks.to(self.device) if masks.any() else None
        self._fps = torch.tensor([clip.fps for clip in clips], dtype=torch.float64, device=self.device)
        starts = list(accumulate((clip.frames for clip in clips), initial=0))
        self._first = torch.tensor(starts[:-1], device=self.device)
        self._last = torch.tensor(starts[1:], device=self.device) - 1
        poses = [torch.tensor(clip.qpos) for clip in self.clips]
        velocities = [clip_velocities(character, qpos, clip.fps) for qpos, clip in zip(poses, self.clips, strict=True)]
        self._qpos = torch.cat(poses).to(self.device, torch.float32)
        self._qvel = torch.cat(velocities).to(self.device, torch.float32)
        self._quat_columns = [slice(3, 7), *(joint.qpos for joint in character.joints if joint.kind == "ball")]
        self._quat = torch.stack([self._qpos[:, columns] for columns in self._quat_columns], dim=1)
        self._steps = _frames_of_a_step([clip.fps for clip in clips], self.device)
        self._frames: Tensor | None = None
        self._by_skill = torch.argsort(self.clip_skill, stable=True)
        self._cumulative = torch.cumsum(self.weight[self._by_skill], 0)
        counts = torch.bincount(self.clip_skill, minlength=len(self.skills))
        self._skill_ends = torch.cat((torch.zeros_like(counts[:1]), torch.cumsum(counts, 0)))

    def sample(
        self,
        n: int,
        generator: torch.Generator,
        skill: Tensor | None = None,
        span: float = 0.0,
        *,
        on_frames: bool = False,
    ) -> tuple[Tensor, Tensor]:
        """Draw n moments: a clip by its weight, a time uniform in its duration.

        Args:
            skill: [n] int64 indices into `skills`; each draw is then among the clips of its skill.
            span: [s] that the clip has behind it at each moment, or all that it has where it is shorter.
            on_frames: the time is that of the clip's frame before, of which `window` has the features at hand.

        Returns:
            clip [n] int64 and time [n] float64 [s].

        Raises:
            MotionError: a skill that the library does not have.
        """
        ends = self._skill_ends
        if skill is None:
            first, after = ends[:1], ends[-1:]
        else:
            skill = skill.to(self.device)
            if skill.shape != (n,) or (n and not 0 <= int(skill.min()) <= int(skill.max()) < len(self.skills)):
                raise MotionError(f"skill must be [{n}] indices of the {len(self.skills)} skills in .skills")
            first, after = ends[skill], ends[skill + 1]
        u, v = torch.rand(2, n, dtype=torch.float64, generator=generator, device=generator.device).to(self.device)
        # the clips lie along a line, each as long as its weight, those of a skill side by side
        low = torch.where(first > 0, self._cumulative[first - 1], 0.0)
        point = low + u * (self._cumulative[after - 1] - low)
        index = torch.searchsorted(self._cumulative, point, right=True)
        clip = self._by_skill[torch.minimum(torch.maximum(index, first), after - 1)]
        first_time = self.duration[clip].clamp_max(span)
        time = first_time + v * (self.duration[clip] - first_time)
        if on_frames:
            time = (time * self._fps[clip] + _ON_FRAME).floor() / self._fps[clip]
        return clip, time

    def pose(self, clip: Tensor, time: Tensor) -> tuple[Tensor, Tensor]:
        """Poses and velocities at these moments.

        Positions and hinges are interpolated linearly, rotations along the shorter arc; velocities are those of the
        frame before, as in the papers' code.

        Args:
            clip: [n] int64.
            time: [n] [s], clamped to the clip's duration.

        Returns:
            qpos [n, nq] and qvel [n, nv], float32, in MuJoCo's layout.
        """
        frame = time.double() * self._fps[clip]
        nearest = frame.round()
        frame = torch.where((frame - nearest).abs() < _ON_FRAME, nearest, frame).clamp_min(0.0)
        frame = torch.minimum(frame + self._first[clip], self._last[clip].double())
        below = frame.long()
        above = torch.minimum(below + 1, self._last[clip])
        part = (frame - below).float().unsqueeze(-1)
        qpos = torch.lerp(self._qpos.index_select(0, below), self._qpos.index_select(0, above), part)
        quat = slerp(self._quat.index_select(0, below), self._quat.index_select(0, above), part)
        for columns, rotation in zip(self._quat_columns, quat.unbind(1), strict=True):
            qpos[:, columns] = rotation
        return qpos, self._qvel.index_select(0, below)

    def middle(self, names: Sequence[str], frames: int) -> Tensor:
        """The windows in the middle of the clips of these names, `[n, frames, D]` as `window` gives them.

        Raises:
            MotionError: a name that no clip has.
        """
        known = [clip.name for clip in self.clips]
        for name in names:
            if name not in known:
                near = ", ".join(get_close_matches(name, known, n=4, cutoff=0.0))
                raise MotionError(f"clip {name}: there is none of that name; near it are: {near}")
        clip = torch.tensor([known.index(name) for name in names], device=self.device)
        half = 0.5 * (frames - 1) * CONTROL_DT
        return self.window(clip, torch.minimum(0.5 * self.duration[clip] + half, self.duration[clip]), frames)

    def window(self, clip: Tensor, time: Tensor, frames: int) -> Tensor:
        """Windows that end at these moments, as `Features.window` makes them.

        Args:
            clip: [n] int64.
            time: [n] [s].
            frames: in a window, one control step apart.

        Returns:
            [n, frames, D] float32, oldest first. Before the clip begins its first frame is repeated.
        """
        return self.features.window(self.frames(clip, time, frames))

    def frames(self, clip: Tensor, time: Tensor, frames: int) -> Tensor:
        """The frames `Features.recorded` [n, frames, frame_dim] that end at these moments; see `window`."""
        if (known := self._known_frames(clip, time, frames)) is not None:
            return known
        back = torch.arange(frames - 1, -1, -1, dtype=torch.float64, device=self.device) * CONTROL_DT
        times = time.double().unsqueeze(-1) - back
        qpos, qvel = self.pose(clip.repeat_interleave(frames), times.flatten())
        return self.features.recorded(qpos, qvel).unflatten(0, (len(clip), frames))

    def _known_frames(self, clip: Tensor, time: Tensor, frames: int) -> Tensor | None:
        """`frames` where all its moments are frames of the clips, out of what was made once; else None."""
        frame = time.double() * self._fps[clip]
        nearest = frame.round()
        if self._steps is None or ((frame - nearest).abs() > _ON_FRAME).any():
            return None
        if self._frames is None:
            self._frames = self.features.recorded(self._qpos, self._qvel)
        back = torch.arange(frames - 1, -1, -1, device=self.device) * self._steps[clip].unsqueeze(-1)
        last = torch.minimum(nearest.long() + self._first[clip], self._last[clip]).unsqueeze(-1)
        return self._frames[torch.maximum(last - back, self._first[clip].unsqueeze(-1))]


def _frames_of_a_step(fps: Sequence[float], device: torch.device) -> Tensor | None:
    """[C] frames of each clip in a control step; None where one of them has no whole number."""
    ratios = torch.tensor(fps, dtype=torch.float64, device=device) * CONTROL_DT
    whole = ratios.round()
    return whole.long() if ((ratios - whole).abs() < 1e-9).all() and (whole >= 1).all() else None
