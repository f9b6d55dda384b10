"""Processes that train one agent together, each with worlds of its own: the only place that knows torch.distributed.

All ranks have the same weights and the same generator, and draw everything random for all worlds; each keeps what is
its own (`Part`). Gradients and statistics are averaged. K ranks so learn what one process with all the worlds learns,
up to the order of summation. On its own (`ALONE`) nothing here computes anything.
"""

import os
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from functools import cached_property
from typing import Any, TypeVar

import torch
import torch.distributed as dist
from torch import Tensor, nn
from torch.distributed.distributed_c10d import PrefixStore, Store
from torch.distributed.rendezvous import rendezvous

from murmillo.agents.common.errors import AgentError

PATIENCE = timedelta(minutes=30)
"""A rank that says nothing for so long is given up."""

T = TypeVar("T")


@dataclass(frozen=True)
class Ranks:
    """The processes of a run, as one of them sees them. Every method but `fork` must be called by all of them.

    Attributes:
        rank: of this process, from 0.
        size: how many there are.
    """

    rank: int = 0
    size: int = 1

    @property
    def first(self) -> bool:
        """Whether this is the one that writes and speaks."""
        return self.rank == 0

    def sum(self, x: Tensor) -> Tensor:
        """The sum of the ranks' tensors, of one shape; of bools, whether any is true."""
        if self.size == 1:
            return x
        total = x.to(torch.int32) if x.dtype == torch.bool else x.detach().clone(memory_format=torch.contiguous_format)
        _talk(lambda: dist.all_reduce(total))
        return total.bool() if x.dtype == torch.bool else total

    def mean(self, x: Tensor) -> Tensor:
        """The mean of the ranks' tensors, of one shape."""
        return x if self.size == 1 else self.sum(x) / self.size

    def mean_scalars(self, scalars: Mapping[str, float]) -> dict[str, float]:
        """The mean of the ranks' scalars, by name."""
        if self.size == 1 or not scalars:
            return dict(scalars)
        means = self.mean(torch.tensor(list(scalars.values()), dtype=torch.float64))
        return dict(zip(scalars, means.tolist(), strict=True))

    def any(self, flag: bool) -> bool:
        """Whether it is true on any rank."""
        return flag if self.size == 1 else bool(self.sum(torch.tensor(flag)))

    def moments(self, count: int, mean: Tensor, var: Tensor) -> tuple[int, Tensor, Tensor]:
        """Number, mean and variance of the elements of all ranks from those of this one's (Chan et al.)."""
        if self.size == 1:
            return count, mean, var
        total = int(self.sum(torch.tensor(count)))
        pooled = self.sum(mean * count) / total
        return total, pooled, self.sum((var + (mean - pooled).square()) * count) / total

    def average_gradients(self, parameters: Iterable[nn.Parameter]) -> None:
        """Put the mean of the ranks' gradients into each; the same parameters have one on all ranks."""
        if self.size == 1:
            return
        gradients = [parameter.grad for parameter in parameters if parameter.grad is not None]
        flat = self.mean(torch.cat([gradient.flatten() for gradient in gradients]))
        for gradient, mean in zip(gradients, flat.split([gradient.numel() for gradient in gradients]), strict=True):
            gradient.copy_(mean.view_as(gradient))

    def copy_first(self, module: nn.Module) -> None:
        """Give all ranks the first one's parameters and buffers."""
        if self.size > 1:
            for value in module.state_dict().values():
                _talk(lambda value=value: dist.broadcast(value, 0))

    def told(self, value: T) -> T:
        """The first rank's value: what pickles."""
        values = [value]
        if self.size > 1:
            _talk(lambda: dist.broadcast_object_list(values, 0))
        return values[0]

    def gather(self, value: T) -> list[T]:
        """The values of all ranks, in their order."""
        values: list[Any] = [value] * self.size
        if self.size > 1:
            _talk(lambda: dist.all_gather_object(values, value))
        return values

    def collect(self, value: T) -> list[T]:
        """The values of all ranks on the first; nothing on the others."""
        if self.size == 1:
            return [value]
        values: list[Any] | None = [None] * self.size if self.first else None
        _talk(lambda: dist.gather_object(value, values))
        return values or []

    def fork(self, generator: torch.Generator) -> torch.Generator:
        """A generator for draws that need not be those of a single process; at size 1 the generator itself.

        It is the rank's own, of a seed that all ranks draw. This needs no talk.
        """
        if self.size == 1:
            return generator
        seed = int(torch.randint(2**31, (), generator=generator, device=generator.device))
        return torch.Generator(generator.device).manual_seed(seed * self.size + self.rank)

    # --- who has which rows ------------------------------------------------------------------------------------------

    def worlds(self, n: int) -> "Part":
        """This rank's n worlds; each rank has as many, and they are counted rank by rank."""
        return Part(self, n) if self.size == 1 else Part(self, n * self.size, slice(self.rank * n, (self.rank + 1) * n))

    def among(self, n: int) -> "Part":
        """n rows of this rank, and some of each other; they are counted rank by rank."""
        if self.size == 1:
            return Part(self, n)
        counts = torch.zeros(self.size, dtype=torch.int64)
        counts[self.rank] = n
        counts = self.sum(counts).tolist()
        before = sum(counts[: self.rank])
        return Part(self, sum(counts), slice(before, before + n))

    def share(self, total: int) -> "Part":
        """An even share of a batch of rows that are nobody's, such as demonstrations."""
        if self.size == 1:
            return Part(self, total)
        begin, end = (total * rank // self.size for rank in (self.rank, self.rank + 1))
        return self.part(total, torch.arange(begin, end))

    def part(self, total: int, place: Tensor) -> "Part":
        """The rows at these places `[n]` of a batch to learn from; without any it is the first, which weighs nothing.

        Needs no talk.
        """
        if not len(place):
            return Part(self, total, place.new_zeros(1), 0.0)
        return Part(self, total, place, self.size * len(place) / total)


@dataclass(frozen=True)
class Part:
    """Which rows of a batch are this rank's.

    Attributes:
        ranks: who share the batch.
        total: rows of the batch.
        place: of this rank's rows in the batch, `[n]` int64 or a slice; None is all of them.
        weight: the rank's means over its rows are to be multiplied by it, so that the mean over all ranks is that over
            the batch.
    """

    ranks: Ranks
    total: int
    place: Tensor | slice | None = None
    weight: float = 1.0

    def of(self, x: T) -> T:
        """This rank's rows of a tensor `[total, ...]` that every rank has; None of None."""
        return x if x is None or self.place is None else x[self.place]  # type: ignore[index]

    def drawn(
        self, draw: Callable[..., dict[str, Tensor]], generator: torch.Generator, **asked: Any
    ) -> dict[str, Tensor]:
        """This rank's rows of what `draw(total, generator, **asked)` gives (`interface.Demonstrations`)."""
        of = {} if self.place is None else {"rows": self.place}
        return draw(self.total, generator, **asked, **of)

    def weigh(self, means: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Means over this rank's rows, by name, times the weight."""
        return dict(means) if self.place is None else {name: self.weight * mean for name, mean in means.items()}

    def spread(self, x: Tensor) -> Tensor:
        """This rank's rows at their places in a tensor `[total, ...]`, the others' rows being zero."""
        if self.place is None:
            return x
        batch = x.new_zeros(self.total, *x.shape[1:])
        if self.weight:
            batch[self.place] = x
        return batch

    def whole(self, x: Tensor) -> Tensor:
        """The rows of all ranks, `[total, ...]`, on every rank. All must call it.

        Gradients flow to the rank's own rows, enlarged so that the mean over the ranks is that of a function of the
        whole batch that every rank computes.
        """
        return x if self.place is None else _Whole.apply(x, self)  # type: ignore[return-value]

    def among(self, rows: Tensor) -> "tuple[Tensor, Part]":
        """Which of this rank's rows are in a batch of `rows` `[m]` out of this one, and where in it they stand."""
        if self.place is None:
            return rows, Part(self.ranks, len(rows))
        own = self._own[rows]
        place = (own >= 0).nonzero().flatten()
        part = self.ranks.part(len(rows), place)
        return (own[place] if len(place) else place.new_zeros(1)), part

    @cached_property
    def _own(self) -> Tensor:
        """The number among this rank's rows of each row of the batch `[total]`; -1 where it is another's."""
        own = torch.full((self.total,), -1)
        places = torch.arange(self.total)[self.place]
        own[places] = torch.arange(len(places))
        return own


class _Whole(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor, part: Part) -> Tensor:
        ctx.part = part
        return part.ranks.sum(part.spread(x))

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:  # type: ignore[override]
        return ctx.part.of(gradient) * ctx.part.ranks.size, None


ALONE = Ranks()
"""The one process of a run that is not shared."""


@contextmanager
def joined() -> Iterator[Ranks]:
    """Within, the ranks that torchrun has started this process as one of; `ALONE` if it has not.

    Tensors of a CPU go by gloo, those of a GPU by nccl.
    """
    if "RANK" not in os.environ or "WORLD_SIZE" not in os.environ:
        yield ALONE
        return
    rank, size = int(os.environ["RANK"]), int(os.environ["WORLD_SIZE"])
    if size == 1:
        yield ALONE
        return
    gpu = torch.cuda.is_available()
    if gpu:
        torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", 0)))
    _talk(lambda: _meet(rank, size, "cpu:gloo,cuda:nccl" if gpu else "gloo"))
    try:
        yield Ranks(rank, size)
    finally:
        dist.destroy_process_group()


def _meet(rank: int, size: int, backend: str) -> None:
    """Find the other ranks through torchrun's store."""
    store, _, _ = next(iter(rendezvous("env://", rank, size, timeout=PATIENCE)))
    store = PrefixStore(_password(store, rank, size), store)
    dist.init_process_group(backend, store=store, rank=rank, world_size=size, timeout=PATIENCE)


def _password(store: Store, rank: int, size: int) -> str:
    """A word that only these processes know.

    torchrun's store outlives its processes: without a name of their own, those that are started again may find there
    where the former ones could be reached, and wait for them. So every rank calls with a word of its own, and the first
    answers it.
    """
    word = uuid.uuid4().hex
    if rank:
        store.set(f"call/{rank}", word)
        password = store.get(f"answer/{word}").decode()
        store.set(f"{password}/{rank}", "heard")
        return password
    absent, begun = set(range(1, size)), time.monotonic()
    while absent:
        if time.monotonic() - begun > PATIENCE.total_seconds():
            raise RuntimeError(f"rank {min(absent)} has not come")
        for other in absent:
            if store.check([f"call/{other}"]):
                store.set(f"answer/{store.get(f'call/{other}').decode()}", word)
        time.sleep(0.01)
        absent = {other for other in absent if not store.check([f"{word}/{other}"])}
    return word


def _talk(say: Callable[[], Any]) -> None:
    """Talk to the other ranks.

    Raises:
        AgentError: one of them is gone.
    """
    try:
        say()
    except RuntimeError as error:
        reason = str(error).splitlines()[0][:160]
        raise AgentError(
            f"another rank was lost ({reason}); torchrun --max-restarts=3 begins again from the last checkpoint"
        ) from None
