"""How the character is seen: one form of features for the simulation and for clips, as frames and what is made of them.

A frame holds a moment; `state` and `window` make observations of the frames up to now. ASE, CALM and C·ASE see a frame
by itself, AdaptNet all frames from where the character is now.
"""

from collections.abc import Collection
from typing import Literal, Protocol

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.observations import character_state, feature_mask, idle_bodies, state_dim
from murmillo.envs.physics import State
from murmillo.envs.rotations import heading_quat, quat_conj, quat_mul, quat_rotate

FEATURES = ("character", "links")

Worlds = Tensor | slice


class Features(Protocol):
    """A form of features.

    The ground is at height 0 where no heights [n] of it, under the root of each newest frame, are given [m].

    Attributes:
        frames: how many of the last frames `state` is made of.
        frame_dim: numbers of a frame.
        state_shape: shape of a state.
        window_dim: numbers of each frame of a window.
    """

    frames: int
    frame_dim: int
    state_shape: tuple[int, ...]
    window_dim: int

    def simulated(self, state: State, worlds: Worlds, ground: Tensor | None = None) -> Tensor:
        """[n, frame_dim] float32, the current frames of these worlds."""
        ...

    def recorded(self, qpos: Tensor, qvel: Tensor) -> Tensor:
        """[..., frame_dim] float32, the frames of clips of `Character.base`: qpos [..., nq] and qvel [..., nv]."""
        ...

    def moved(self, frames: Tensor, by: Tensor) -> Tensor:
        """Frames [n, W, frame_dim] as they were, had all happened elsewhere by [n, 3] [m]."""
        ...

    def state(self, frames: Tensor, length: Tensor, ground: Tensor | None = None) -> dict[str, Tensor]:
        """What a policy sees of frames [n, frames, frame_dim], oldest first, of which the last length [n] count."""
        ...

    def window(self, frames: Tensor, ground: Tensor | None = None) -> Tensor:
        """[n, W, window_dim], what a discriminator sees of the frames [n, W, frame_dim], oldest first."""
        ...

    def mask(self, masked: Collection[str]) -> Tensor:
        """[window_dim] bool: what a window's frame tells of these key bodies, for clips that know nothing of them."""
        ...


def make_features(name: Literal["character", "links"], character: Character) -> Features:
    """The features of this name, one of `FEATURES`."""
    return CharacterFeatures(character) if name == "character" else LinkFeatures(character)


class CharacterFeatures:
    """`character_state` of `Character.base`: the state is the newest frame, a window the frames themselves.

    Frames know no place and have their heights above the ground: those that are moved stay as they are.
    """

    frames = 1

    def __init__(self, character: Character) -> None:
        self._character = character
        self.frame_dim = self.window_dim = state_dim(character.base)
        self.state_shape = (self.frame_dim,)

    def simulated(self, state: State, worlds: Worlds, ground: Tensor | None = None) -> Tensor:
        qpos, qvel = self._character.to_base(state.qpos[worlds], state.qvel[worlds])
        frame = character_state(self._character.base, qpos, qvel, state.key_pos_w[worlds])
        if ground is not None:
            frame[:, 0] -= ground
        return frame

    def recorded(self, qpos: Tensor, qvel: Tensor) -> Tensor:
        base = self._character.base
        return character_state(base, qpos, qvel, base.key_positions(qpos))

    def moved(self, frames: Tensor, by: Tensor) -> Tensor:
        return frames

    def state(self, frames: Tensor, length: Tensor, ground: Tensor | None = None) -> dict[str, Tensor]:
        return {"state": frames[:, -1]}

    def window(self, frames: Tensor, ground: Tensor | None = None) -> Tensor:
        return frames

    def mask(self, masked: Collection[str]) -> Tensor:
        return feature_mask(self._character.base, masked)


class LinkFeatures:
    """AdaptNet's observation (its section 7): the links of the last frames, seen from where the character is now.

    A frame has, for each body in MJCF order, position (3) [m], rotation (4, wxyz), linear velocity of the origin (3)
    [m/s] and angular velocity (3) [rad/s], in the world. Observations show all of their frames in one frame of
    reference: its origin is on the ground under the newest root and it turns with that root's yaw. Rotations are those
    with w >= 0, so that the sign of a quaternion tells nothing of where it comes from.

    The state is [4, 13 B], the last four frames, those of this episode first and zeros behind, with their number as
    `length`; a window is [W, 7 B], positions and rotations alone.
    """

    frames = 4

    def __init__(self, character: Character) -> None:
        self._character, self._bodies = character, len(character.bodies)
        self.frame_dim, self.window_dim = 13 * self._bodies, 7 * self._bodies
        self.state_shape = (self.frames, self.frame_dim)

    def simulated(self, state: State, worlds: Worlds, ground: Tensor | None = None) -> Tensor:
        pos_w, quat_w = state.body_pos_w[worlds], state.body_quat_w[worlds]
        return _joined(pos_w, quat_w, *self._character.velocities(pos_w, quat_w, state.qvel[worlds])).float()

    def recorded(self, qpos: Tensor, qvel: Tensor) -> Tensor:
        pos_w, quat_w = self._character.base.forward_kinematics(qpos)
        return _joined(pos_w, quat_w, *self._character.base.velocities(pos_w, quat_w, qvel)).float()

    def moved(self, frames: Tensor, by: Tensor) -> Tensor:
        links = frames.unflatten(-1, (self._bodies, 13)).clone()
        links[..., :3] += by.to(frames)[:, None, None]
        return links.flatten(-2)

    def state(self, frames: Tensor, length: Tensor, ground: Tensor | None = None) -> dict[str, Tensor]:
        length = length.clamp_max(self.frames)
        pos, quat, linear, angular = self._seen(frames, ground)
        seen = _joined(pos, quat, linear, angular)
        slots = torch.arange(self.frames, device=frames.device)
        source = slots + (self.frames - length).unsqueeze(-1)
        packed = seen.gather(1, source.clamp_max(self.frames - 1).unsqueeze(-1).expand_as(seen))
        empty = (slots >= length.unsqueeze(-1)).unsqueeze(-1)
        return {"state": packed.masked_fill(empty, 0.0), "length": length}

    def window(self, frames: Tensor, ground: Tensor | None = None) -> Tensor:
        pos, quat, *_ = self._seen(frames, ground, velocities=False)
        return _joined(pos, quat)

    def mask(self, masked: Collection[str]) -> Tensor:
        bodies, idle = self._character.bodies, idle_bodies(self._character, masked)
        unknown = torch.tensor([body in masked for body in bodies]).unsqueeze(-1)
        unturned = torch.tensor([body in idle for body in bodies]).unsqueeze(-1) | unknown
        return torch.cat((unknown.expand(-1, 3), unturned.expand(-1, 4)), dim=-1).flatten()

    def _seen(self, frames: Tensor, ground: Tensor | None, velocities: bool = True) -> list[Tensor]:
        """The parts [n, W, B, 3 or 4] of the frames, from the newest root."""
        pos_w, quat_w, linear_w, angular_w = frames.unflatten(-1, (self._bodies, 13)).split([3, 4, 3, 3], dim=-1)
        origin_w = pos_w[:, -1:, :1].clone()
        origin_w[..., 2] = 0.0 if ground is None else ground.to(frames)[:, None, None]
        to_heading = quat_conj(heading_quat(quat_w[:, -1:, :1]))
        quat = quat_mul(to_heading, quat_w)
        parts = [quat_rotate(to_heading, pos_w - origin_w), torch.where(quat[..., :1] < 0.0, -quat, quat)]
        return parts + [quat_rotate(to_heading, part) for part in ((linear_w, angular_w) if velocities else ())]


def _joined(*parts: Tensor) -> Tensor:
    """[..., B * sum of widths]: the parts [..., B, width] of each body side by side."""
    return torch.cat(parts, dim=-1).flatten(-2)
