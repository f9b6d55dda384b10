"""The motion clip that each transition of a trajectory is nearest to: exact, and at the speed of a float32 product."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import torch
from torch import Tensor

from murmillo.envs.errors import MotionError, SuiteError

_CONSTANT = 1e-6
"""A feature that varies less, against its largest value or one unit, is constant but for the rounding of float32."""
_ROWS = 512
"""Transitions that are screened at once: their products with a clip stay in a core's cache."""
_PAIRS = 8192
"""Pairs of transitions that are measured in float64 at once: 8 MB an operand of 120 features."""
_FAR = 1e6
"""[deviations] No state is as far off. Up to here float64's own rounding stays far below the bound of float32's."""


class ClipMatcher:
    """Finds the clip that holds the transition nearest to a given one (ASE, eq. 22; C·ASE, eq. 8).

        m* = argmin_m  min_{(s, s') in m}  ||s_t - s||^2 + ||s_{t+1} - s'||^2

    over features normalised by their mean and (population) deviation over the frames of the distinct clips. C·ASE
    writes norms where ASE has their squares, and refers to ASE; here they are squared. A feature that is constant over
    the clips adds the same to every distance and is left out; so is what differs from a constant by rounding alone,
    such as the sideways part of the root's tangent in its own heading frame, which a deviation of 1e-7 would otherwise
    blow up a million times.

    The answer is that of float64 arithmetic, at any number of threads and however the trajectories are divided. Most of
    the work is one product of matrices in float32: |s_t - s|^2 = |s_t|^2 + (|s|^2 - 2 s_t s), where the bracket is all
    that tells frames apart, and the brackets of two frames that follow each other add up to that of a transition. Its
    rounding error has a bound that holds for every order of summation; a clip whose least distance is further above the
    best than the two bounds allow is out, and where several are left float64 decides.

    Attributes:
        distinct: indices of the clips that count: of bit-identical ones the first.
    """

    def __init__(self, clips: Sequence[Tensor]) -> None:
        """Normalises the clips.

        Args:
            clips: [F_c, D] states of each clip, a frame a control step, F_c >= 2.

        Raises:
            MotionError: no clips, a clip with a single state, with another width, or with a NaN or an infinity.
        """
        if not clips:
            raise MotionError("nearest clip: there are no clips to match; give at least one")
        for index, clip in enumerate(clips):
            if clip.ndim != 2 or len(clip) < 2 or clip.shape[1] != clips[0].shape[-1]:
                raise MotionError(
                    f"nearest clip: clip {index} has states {list(clip.shape)}; it needs [F, {clips[0].shape[-1]}] "
                    "with at least 2, a control step apart"
                )
            if not clip.isfinite().all():
                raise MotionError(f"nearest clip: clip {index} has a NaN or an infinity; export it anew")
        first = {(clip.shape, clip.cpu().numpy().tobytes()): index for index, clip in reversed([*enumerate(clips)])}
        self.distinct: tuple[int, ...] = tuple(sorted(first.values()))
        frames = torch.cat([clips[index] for index in self.distinct]).double()
        self._mean, deviation = frames.mean(0), frames.std(0, correction=0)
        self._kept = deviation > _CONSTANT * frames.abs().amax(0).clamp_min(1.0)
        self._mean, self._deviation = self._mean[self._kept], deviation[self._kept]
        self._width = len(self._kept)
        self._clips = [self._normalised(clips[index].double()) for index in self.distinct]
        self._screens = [_screen(clip) for clip in self._clips]
        # what each clip's rounding errors are measured by: the norm of its frame furthest from the mean
        self._reach = torch.stack([clip.norm(dim=1).amax() for clip in self._clips])
        terms = len(self._mean) + 8  # of the product, and the roundings of its factors, of |s|^2 and of the last sum
        self._rounding = terms * 2.0**-24 / (1.0 - terms * 2.0**-24)

    def nearest(self, state: Tensor) -> Tensor:
        """The clip nearest to each transition.

        Args:
            state: [n, T + 1, D] states of n trajectories, a control step apart. What is needed beside it does not
                grow with n, so that a long recording can be matched a piece at a time.

        Returns:
            [n, T] int64 indices of clips, all in `distinct`; where several are equally near, the lowest.

        Raises:
            SuiteError: states of another width, one that diverged, or torch set to multiply float32 in less precision.
        """
        if state.ndim != 3 or state.shape[2] != self._width:
            raise SuiteError(
                f"nearest clip: trajectories have states {list(state.shape)}; the clips need [n, T + 1, {self._width}]"
            )
        if torch.get_float32_matmul_precision() != "highest":
            raise SuiteError(
                "nearest clip: torch multiplies float32 in a lower precision, whose rounding has another bound; "
                "call torch.set_float32_matmul_precision('highest')"
            )
        # pairs that straddle two trajectories are matched with the others, which is simpler, and cut off at the end
        flat = state.flatten(0, 1)
        number = torch.zeros(state.shape[:2], dtype=torch.int64, device=state.device)

        def match(start: int) -> None:
            block = self._normalised(flat[start : start + _ROWS + 1].double())
            diverged = ~(block.abs() < _FAR).all(1)
            if diverged.any():
                trajectory, step = divmod(start + int(diverged.long().argmax()), state.shape[1])
                raise SuiteError(
                    f"nearest clip: trajectory {trajectory}, state {step} has a NaN, an infinity or a number far "
                    "beyond all clips; leave out the trajectories that diverged"
                )
            number.view(-1)[start : start + len(block) - 1] = self._match(block)

        with _workers() as pool:
            list(pool.map(match, range(0, len(flat) - 1, _ROWS)))
        return torch.tensor(self.distinct, device=state.device)[number[:, :-1]]

    def _match(self, state: Tensor) -> Tensor:
        """[R] number among the distinct clips of the one nearest to each transition of [R + 1, D] normalised states."""
        norm = state.norm(dim=1)
        rows = torch.cat([state, torch.ones_like(state[:, :1])], dim=1).float()
        least = torch.stack([_transitions(rows @ screen).amin(1) for screen in self._screens], dim=1).double()
        bound = self._rounding * 2.0 * (self._reach * (norm[:-1] + norm[1:])[:, None] + self._reach.square())
        nearest_possible = (least + bound).amin(1, keepdim=True)
        open_clips = least - bound <= nearest_possible
        matched = least.argmin(1)
        undecided = (open_clips.sum(1) > 1).nonzero().squeeze(1)
        if len(undecided):
            limit = nearest_possible + bound
            matched[undecided] = self._decide(state, rows, undecided, open_clips[undecided], limit[undecided])
        return matched

    def _decide(self, state: Tensor, rows: Tensor, transition: Tensor, open_clips: Tensor, limit: Tensor) -> Tensor:
        """[m] number of the nearest clip to these transitions [m], in float64.

        Only pairs whose float32 distance is below `limit` [m, K] are measured, in the clips that are open to them
        [m, K].
        """
        distance = torch.full_like(limit, torch.inf)
        for number in open_clips.any(0).nonzero().squeeze(1).tolist():
            clip, screen = self._clips[number], self._screens[number]
            among = open_clips[:, number].nonzero().squeeze(1)
            first = transition[among]
            screened = (rows[first] @ screen)[:, :-1] + (rows[first + 1] @ screen)[:, 1:]
            near = (screened.double() <= limit[among, number, None]).nonzero()
            for pair, frame in (part.unbind(1) for part in near.split(_PAIRS)):
                exact = _squares(state[first[pair]] - clip[frame]) + _squares(state[first[pair] + 1] - clip[frame + 1])
                distance[:, number].scatter_reduce_(0, among[pair], exact, "amin")
        return distance.argmin(1)

    def _normalised(self, state: Tensor) -> Tensor:
        return (state[..., self._kept] - self._mean) / self._deviation


@contextmanager
def _workers() -> Iterator[ThreadPoolExecutor]:
    """As many threads as torch has, each computing alone: a product here is too small to be shared out."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # which new threads take over
    try:
        with ThreadPoolExecutor(threads) as pool:
            yield pool
    finally:
        torch.set_num_threads(threads)


def _screen(clip: Tensor) -> Tensor:
    """[D + 1, F] float32 factor that turns a state, with a one behind it, into its distance² less its own norm²."""
    return torch.cat([-2.0 * clip, _squares(clip)[:, None]], dim=1).float().T.contiguous()


def _transitions(frame: Tensor) -> Tensor:
    """[R, F - 1] sums over the two frames of each transition, from [R + 1, F] of each frame."""
    return frame[:-1, :-1] + frame[1:, 1:]


def _squares(vector: Tensor) -> Tensor:
    return vector.square().sum(-1)
