"""What learners are shown of the clips: windows of states, and states with the action that leads to the next pose."""

from functools import cached_property

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.motion.grid import FrameGrid
from murmillo.envs.motion.library import MotionLibrary


class Demonstrations:
    """Draws from a library of clips, in the form in which the environment shows its own worlds."""

    def __init__(self, library: MotionLibrary, character: Character, window: int, action_dim: int) -> None:
        """Windows have `window` frames unless asked otherwise; actions of `character` have `action_dim` components."""
        self._library, self._character, self._window, self._action_dim = library, character, window, action_dim

    def __call__(
        self,
        n: int,
        generator: torch.Generator,
        skill: Tensor | None = None,
        frames: int | None = None,
        rows: Tensor | slice | None = None,
    ) -> dict[str, Tensor]:
        """Windows of the clips, made by the function that makes the observations.

        They end at any time of a clip, to an eighth of a control step where `FrameGrid` has room for the clips, and
        repeat its first frame where they begin before it. If their length is asked for with `frames`, they lie within
        their clips as far as those are long enough, and end at one of their frames. Of the n that are drawn only `rows`
        are made, if they are given.

        Returns:
            window: [n, W, D], 120 wide or as `Features.window` has it; skill: [n] their labels, of the skills [n] asked
            for, or by the clips' weights. Where clips were made without a sword or a shield, also mask: [n, D] bool,
            true for features that are made up.
        """
        library = self._library
        span = 0.0 if frames is None else (frames - 1) * library.character.control_dt
        clip, time = library.sample(n, generator, skill, span, on_frames=frames is not None)
        if rows is not None:
            clip, time = clip[rows], time[rows]
        made = self._grid if frames is None and self._grid is not None else library
        drawn = {"window": made.window(clip, time, frames or self._window), "skill": library.clip_skill[clip]}
        return drawn if library.mask is None else drawn | {"mask": library.mask[clip]}

    @cached_property
    def _grid(self) -> FrameGrid | None:
        """Made when windows are first drawn, since not everybody draws any."""
        return FrameGrid.of(self._library)

    def imitation_pairs(self, n: int, generator: torch.Generator) -> dict[str, Tensor]:
        """`state` [n, ...] of the clips on level ground, their `skill` [n], and the `action` [n, A] to the next pose.

        States are what `Features.state` gives of full frames, `length` too where the features have one.
        """
        library, character = self._library, self._character
        clip, time = library.sample(n, generator)
        qpos_next, qvel_next = library.pose(clip, time + character.control_dt)
        action = torch.zeros(n, self._action_dim)
        action[:, : character.action_dim] = character.action_for(character.from_base(qpos_next, qvel_next)[0])
        features = library.features
        frames, full = library.frames(clip, time, features.frames), torch.full((n,), features.frames)
        return {**features.state(frames, full), "skill": library.clip_skill[clip], "action": action}
