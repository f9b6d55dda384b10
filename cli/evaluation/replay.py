"""The clips themselves, replayed as they are: the upper bound of what a policy can do by these protocols."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from murmillo.cli.evaluation.commands import Command
from murmillo.cli.evaluation.protocols import WINDOW, Protocol
from murmillo.cli.evaluation.recording import Recording, Tick
from murmillo.envs.character import CONTROL_DT, Character
from murmillo.envs.motion import MotionLibrary
from murmillo.envs.motion.ground import GROUNDED, ground_of


def clip_times(duration: float) -> Tensor:
    """[F] [s] the moments of a clip that lie a control step apart, from its beginning."""
    return torch.arange(int(duration / CONTROL_DT + 1e-4) + 1, dtype=torch.float64) * CONTROL_DT


def clip_states(library: MotionLibrary) -> list[Tensor]:
    """States [F_c, D] of each clip, a frame a control step."""
    states = []
    for number, duration in enumerate(library.duration.tolist()):
        times = clip_times(duration)
        states.append(library.window(torch.full((len(times),), number), times, 1)[:, 0])
    return states


class Replayer:
    """Replays clips from random moments on; a clip that ends begins again, where its root then is."""

    def __init__(self, character: Character, library: MotionLibrary, states: Sequence[Tensor]) -> None:
        """`states` are those of `clip_states`."""
        frames = [_frames(character, library, number) for number in range(len(library.clips))]
        self._frames = {name: torch.cat([clip[name] for clip in frames]) for name in frames[0]}
        self._frames["state"] = torch.cat([*states])
        self._quat = self._frames.pop("root_quat_w")
        self._length = torch.tensor([len(clip["root_pos_w"]) for clip in frames])
        self._offset = self._length.cumsum(0) - self._length
        self._skill = library.clip_skill
        self._travel = torch.stack([clip["root_pos_w"][-1] - clip["root_pos_w"][0] for clip in frames])
        self._travel[:, 2] = 0.0

    def record(self, protocol: Protocol, numbers: Tensor, generator: torch.Generator, tick: Tick) -> Recording:
        """Trajectories that follow the clips in turn, and random ones after a change of command."""
        n = len(numbers)
        switch = protocol.draw_switch(n, generator)
        cut = protocol.draw_cut(n, generator)
        first = numbers % len(self._length)
        second = torch.randint(len(self._length), (n,), generator=generator)
        # the window that is cut out lies within the clip, where that is long enough
        inside = (self._length[first] - WINDOW).clamp_min(0) + 1
        begin = (torch.rand(n, generator=generator) * inside).long() - cut
        step = torch.arange(protocol.steps + 1)
        # the state at the switch is the last of the first clip
        late = step > switch[:, None]
        clip = torch.where(late, second[:, None], first[:, None])
        since = torch.where(late, step - switch[:, None] - 1, begin[:, None] + step)
        row = self._offset[clip] + since % self._length[clip]
        recorded = {name: frames[row] for name, frames in self._frames.items()}
        moved = (since // self._length[clip])[..., None] * self._travel[clip]
        recorded["root_pos_w"] = recorded["root_pos_w"] + moved
        for name in ("key_pos_w", "foot_pos_w"):
            recorded[name] = recorded[name] + moved[:, :, None]
        tick(n * protocol.steps)
        healed = torch.zeros(n, dtype=torch.bool)
        command = Command(torch.zeros(n, 0), self._skill[first], first)
        start_quat_w = self._quat[row[:, :1]]
        return Recording(command=command, switch=switch, cut=cut, healed=healed, start_quat_w=start_quat_w, **recorded)


def _frames(character: Character, library: MotionLibrary, number: int) -> dict[str, Tensor]:
    """What a recording has of each frame of a clip, but for the state."""
    times = clip_times(library.duration[number].item())
    qpos, _ = library.pose(torch.full((len(times),), number), times)
    body_pos_w, _ = character.forward_kinematics(qpos)
    poses = qpos.double().numpy()
    ground = ground_of(replace(library.clips[number], qpos=poses, fps=1.0 / CONTROL_DT), character)
    feet = np.array(ground.feet)
    stands = [(ground.sole_height[:, feet == foot] < GROUNDED).any(axis=1) for foot in character.feet]
    return {
        "root_pos_w": qpos[:, :3],
        "root_quat_w": qpos[:, 3:7],
        "key_pos_w": body_pos_w[:, character.body_ids(character.key_bodies)],
        "foot_pos_w": body_pos_w[:, character.body_ids(character.feet)],
        "touching": torch.from_numpy(np.stack(stands, axis=1)),
    }
