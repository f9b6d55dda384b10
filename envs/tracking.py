"""How closely the character goes along the clips of the skills that it is commanded, moment by moment."""

from dataclasses import dataclass

import torch
from torch import Tensor

from murmillo.envs.character import CONTROL_DT, Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.motion import MotionLibrary
from murmillo.envs.observations import StateParts, state_parts
from murmillo.envs.skills import CommandedSkills

PROGRESS_SIZE = 10
"""Numbers of `Tracker.progress`."""

_ON_TIME = 1e-9
"""[s] by which times that are meant to be one may differ."""
_SEAM = 0.5
"""[s] A clip does not begin again in its last half second."""
_SETTLED = 0.25
"""[s] after its beginning a clip can be lost."""
_LOOP = 1.0
"""Weighted squares by which a clip's beginning may differ from its end for it to begin there again."""
_REST = 0.2
"""Weighted squares by which a pose may differ from a clip's first or last and still be taken for rest."""
_LOOK = (-12, -9, -6, -4, -2, 0, 1, 2, 4, 6, 9, 12)
"""Control steps from now, the moments of a clip of which the one is looked for that the character is nearest to."""
_GOES_ON = _LOOK.index(1)
_NEARER, _ALIKE = 0.7, 0.5
"""A clip waits or hurries where the weighted squares are less than this of what they are when it goes on, and by more
than this: who stands still is a little nearer to the step before, and far nearer to what lies ten steps back."""
_WAITED = 0.3
"""What is left of the reward while the clip waits: who stays where it is has not followed."""
_FORGOTTEN = 1.0
"""[s] after which little is left of a deviation of the heading."""
_HEADING = 15.0
"""Weight of that deviation's square, which is the root's rotation's."""

_OWN_STATE = ("clip", "time", "held", "error", "turned")


@dataclass
class TrackingConfig:
    """A clip that each world follows, beside whatever else it is rewarded for.

    Attributes:
        follow: whether worlds follow a clip of their commanded skill, by the side reward "tracking".
        lost: an episode ends, as by a fall, where the key points are further than this from the clip's on average [m].
        near: within this of a clip's first pose, by the same measure, the clip begins [m].
        patience: time in which to come there from the middle of another skill [s]; then the clip begins all the same.
            A clip that has begun waits no longer either: whoever makes it has lost it.
        turned: it has lost it too where, within about a second, it has turned by this more or less than the clip [rad].
        switch: probability that another skill is commanded where a clip ends; else it begins again.
    """

    follow: bool = False
    lost: float = 0.5
    near: float = 0.15
    patience: float = 1.0
    turned: float = 0.6
    switch: float = 0.5

    def check(self) -> None:
        """Raise SuiteError for what cannot be."""
        for name in ("lost", "near", "patience", "turned"):
            if not getattr(self, name) >= 0.0:
                raise SuiteError(f"tracking.{name}={getattr(self, name)}: needs at least 0")
        if not 0.0 <= self.switch <= 1.0:
            raise SuiteError(f"tracking.switch={self.switch}: needs a probability between 0 and 1")


class Tracker:
    """Says of N worlds where in which clip they should be, and how far they are from that.

    Who was started in a clip of its own skill goes on there. Whoever is commanded another skill turns to the beginning
    of one of its clips: until the character is near that, or patience is over, the clip waits. A clip that has ended
    goes on where it is most like its end, which of the built-in ones is their beginning, or gives way to another skill.
    Rest at a clip's beginning and end is passed over: who sees only its state cannot tell the one from the other. For
    the same reason a clip waits for whoever is behind, which is then paid less, and hurries after whoever is ahead.
    Who stands still while the clip moves is behind, however near to it.

    What is compared is `character_state`, so that neither place nor heading count, but the speeds do. A speed that is a
    little wrong is a small error, and the feet of a slow turn hardly leave the ground: so the error of the root's spin
    is summed, with a memory of a second. Who stands where the clip turns is soon turned away from it.
    """

    def __init__(
        self,
        character: Character,
        library: MotionLibrary,
        skills: CommandedSkills,
        config: TrackingConfig,
        num_envs: int,
    ) -> None:
        self._library, self._skills, self._config = library, skills, config
        self._parts = state_parts(character.base)
        self._clip = torch.zeros(num_envs, dtype=torch.int64)
        self._time = torch.zeros(num_envs, dtype=torch.float64)
        self._held = torch.zeros(num_envs, dtype=torch.float64)
        self._turned = torch.zeros(num_envs)
        self._character = character
        self._error = torch.zeros(num_envs, 5)
        spans = [self._span(clip) for clip in range(len(library.clips))]
        self._first, self._last, self._again = torch.tensor(spans, dtype=torch.float64).unbind(-1)

    def begin(self, env_ids: Tensor, clip: Tensor, time: Tensor) -> None:
        """These worlds are at `time` [n] [s] of `clip` [n], or at the next moment of it that is no rest."""
        latest = self._last[clip] - CONTROL_DT
        self._held[env_ids], self._turned[env_ids] = 0.0, 0.0
        self._clip[env_ids], self._time[env_ids] = clip, torch.minimum(torch.maximum(time, self._first[clip]), latest)
        self._error[env_ids] = torch.tensor([1.0, 1.0, 1.0, 1.0, 0.0])

    def turn(self, env_ids: Tensor, generator: torch.Generator) -> None:
        """These worlds [n] are to come to the beginning of a clip of their skill, wherever they are."""
        self._clip[env_ids], _ = self._library.sample(len(env_ids), generator, self._skills.current[env_ids])
        self._time[env_ids], self._held[env_ids] = -self._config.patience, 0.0
        self._error[env_ids], self._turned[env_ids] = 0.0, 0.0

    def step(self, state: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """One control step further; what the worlds do and are commanded next.

        Args:
            state: [N, 120] after the step.
            generator: draws clips and skills.

        Returns:
            reward [N] in [0, 1], weighted exponentials of the errors as in DeepMimic (Peng et al. 2018, section 5), of
            two widths each; lost [N] bool.
        """
        others = (self._library.clip_skill[self._clip] != self._skills.current).nonzero().squeeze(-1)
        if len(others):
            self.turn(others, generator)
        first = self._first[self._clip]
        before, begun = self._time, self._time >= first - _ON_TIME
        self._time, squares, distance, spin = self._nearest(state)
        turned = (1.0 - CONTROL_DT / _FORGOTTEN) * self._turned + CONTROL_DT * spin
        self._turned = torch.where(begun, turned, 0.0)
        squares[1] += _HEADING * self._turned.square()
        likeness = _likeness(squares)
        self._error = torch.cat((likeness, distance.unsqueeze(0))).T
        reward = (torch.tensor([[0.4], [0.2], [0.2], [0.2]]) * likeness).sum(0)
        reward = torch.where(self._time > before, reward, _WAITED * reward)
        held = torch.where(self._time > before, -CONTROL_DT, CONTROL_DT)
        self._held = torch.where(begun, (self._held + held).clamp_min(0.0), 0.0)
        lost = (distance > self._config.lost) & (self._time > first + _SETTLED) | (self._held > self._config.patience)
        lost |= self._turned.abs() > self._config.turned
        there = (self._time < first) & ((distance < self._config.near) | (self._time >= 0.0))
        self._time = torch.where(there, first, self._time)
        self._end(generator)
        return reward, lost

    @property
    def progress(self) -> Tensor:
        """[N, 10] what following pays for and a state does not show, for critics.

        They are the four exponentials of the last step's errors, in [0, 1], and the distance of the key points [m]; the
        sine and cosine of where in the clip the character should be; for how long the clip has waited [s], and how long
        it will before it begins in any case [s]; by how much the heading has turned away from the clip's [rad].
        """
        first, last = self._first[self._clip], self._last[self._clip]
        angle = 2 * torch.pi * (self._time - first) / (last - first).clamp_min(CONTROL_DT)
        begins = torch.where(self._time < first, (-self._time).clamp_min(CONTROL_DT), 0.0)
        clock = torch.stack((angle.sin(), angle.cos(), self._held, begins), -1)
        return torch.cat((self._error, clock.float(), self._turned.unsqueeze(-1)), -1)

    @property
    def waited(self) -> Tensor:
        """[N] [s] for which clips that have begun have waited of late."""
        return self._held

    def wanted(self, ahead: float | Tensor) -> tuple[Tensor, Tensor]:
        """Poses [N, nq] and velocities [N, nv] of the clips so much later than now [s], a number or [N]."""
        return self._library.pose(self._clip, self._within(self._time.clamp_min(0.0) + ahead))

    def _within(self, time: Tensor) -> Tensor:
        """Moments [..., N] [s] of the clips: after the end from where they begin again on, the first before that."""
        first, last, again = (ends[self._clip] for ends in (self._first, self._last, self._again))
        return torch.maximum(torch.where(time > last + _ON_TIME, again + time - last, time), first)

    def _nearest(self, state: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """A control step on, at the pace that brings the clip to where it is nearest to the character.

        A policy sees no clock: were the clip's to run on, one that is late would never be right again.

        Returns:
            time [N] [s]; weighted squares [4, N] of the errors; mean distance of the key points [N] [m]; how much
            faster than the clip the root turns [N] [rad/s].
        """
        look, worlds = torch.tensor(_LOOK), torch.arange(len(state))
        times = self._time + CONTROL_DT * look.double().unsqueeze(-1)
        clips = self._clip.expand_as(times)
        wanted = self._library.frames(clips.flatten(), self._within(times).flatten(), 1)[:, 0]
        error = state - wanted.unflatten(0, times.shape)
        if self._library.mask is not None:
            error = error.masked_fill(self._library.mask[self._clip], 0.0)
        squares = torch.stack(_squares(error, self._parts))
        apart = squares.sum(0)
        apart[_GOES_ON] = _NEARER * apart[_GOES_ON] - _ALIKE
        pace = torch.where(self._time < self._first[self._clip], 1, look[apart.argmin(0)].clamp(0, 2))
        chosen = _GOES_ON - 1 + pace
        distance = error[chosen, worlds][:, self._parts.keys].unflatten(-1, (-1, 3)).norm(dim=-1).mean(-1)
        spin = error[chosen, worlds][:, self._parts.angular][:, 2]
        return times[chosen, worlds], squares[:, chosen, worlds], distance, spin

    def _end(self, generator: torch.Generator) -> None:
        """Where clips are over they begin again, or other skills are commanded."""
        over = (self._time >= self._last[self._clip] - 0.5 * CONTROL_DT).nonzero().squeeze(-1)
        if not len(over):
            return
        self._time[over] = self._again[self._clip[over]]
        switched = over[torch.rand(len(over), generator=generator) < self._config.switch]
        if len(switched):
            self._skills.draw(switched, generator)
            self.turn(switched, generator)

    def _span(self, clip: int) -> tuple[float, float, float]:
        """Of a clip: when rest ends and when it begins again [s], and the moment before that is most like this end."""
        end = self._library.duration[clip].item()
        time = torch.arange(int(end / CONTROL_DT + 1e-6) + 1, dtype=torch.float64) * CONTROL_DT
        states = self._library.frames(torch.full((len(time),), clip), time, 1)[:, 0]
        first, last = 0.0, end
        left, arrives = (self._apart(states, other) > _REST for other in (states[:1], states[-1:]))
        if left.any() and arrives.any() and time[arrives][-1] - time[left][0] > _SEAM:
            first, last = time[left][0].item(), time[arrives][-1].item()
        before = (time >= first - 1e-6) & (time <= max(first, last - _SEAM) + 1e-6)
        jump = self._apart(states[before], states[time <= last + 1e-6][-1:])
        return first, last, first if jump[0] < _LOOP else time[before][jump.argmin()].item()

    def _apart(self, states: Tensor, other: Tensor) -> Tensor:
        """[n] how far states [n, 120] are from another [1, 120]."""
        return torch.stack(_squares(states - other, self._parts)).sum(0)

    def state_dict(self) -> dict[str, Tensor]:
        return {name: getattr(self, f"_{name}").clone() for name in _OWN_STATE}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        for name in _OWN_STATE:
            setattr(self, f"_{name}", state[name].clone())


def _squares(error: Tensor, parts: StateParts) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Weighted squares [...] of the errors [..., 120] in joints' rotations, root, root's velocities and key points."""

    def square(columns: slice) -> Tensor:
        return error[..., columns].square().sum(-1)

    root = 600.0 * square(parts.height) + 15.0 * square(parts.rotation)
    velocity = 6.0 * square(parts.linear) + 0.6 * square(parts.angular)
    return 3.0 * square(parts.joints), root, velocity, 9.0 * square(parts.keys)


def _likeness(squares: Tensor) -> Tensor:
    """1 for none, two exponentials of weighted squares: the wider one still leads where the narrow one is flat."""
    return 0.5 * ((-squares).exp() + (-0.2 * squares).exp())
