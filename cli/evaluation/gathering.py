"""Recordings of every source under every protocol, chunk by chunk."""

from collections.abc import Sequence
from typing import NamedTuple
from typing import Protocol as Interface

import numpy as np
import torch
from torch import Tensor

from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation.chunks import ChunkStore
from murmillo.cli.evaluation.digests import Digest, digest
from murmillo.cli.evaluation.display import make_display
from murmillo.cli.evaluation.protocols import PUSHED, Protocol
from murmillo.cli.evaluation.recording import Recording, Tick
from murmillo.cli.evaluation.scene import Scene
from murmillo.cli.evaluation.sources import REPLAYED, SOURCES


class Recorder(Interface):
    """What acts: a policy, or clips."""

    def record(self, protocol: Protocol, numbers: Tensor, generator: torch.Generator, tick: Tick) -> Recording: ...


class Chunk(NamedTuple):
    source: str
    protocol: Protocol
    number: int


def gather(
    store: ChunkStore,
    recorders: dict[str, Recorder],
    protocols: Sequence[Protocol],
    trajectories: int,
    seed: int,
    scene: Scene,
) -> None:
    """Record what the store has not yet.

    A chunk depends on nothing but the store's key, its protocol and its number, whatever was recorded before it.

    Args:
        recorders: by the name of the source; each for as many worlds as a chunk has.
        trajectories: wanted of each source under each protocol.
        scene: has the clips that motions are compared with.
    """
    worlds, clips = store.size, len(scene.library.clips)
    wanted = [
        Chunk(source, protocol, number)
        for source in recorders
        for protocol in protocols
        if responds(source, protocol)
        for number in range(_chunks(protocol, trajectories, worlds))
    ]
    missing = [chunk for chunk in wanted if not store.has(chunk.source, chunk.protocol.name, chunk.number)]
    with make_display(sum(chunk.protocol.steps * worlds for chunk in missing)) as display:
        for source, protocol, number in missing:
            display.doing(f"{SOURCES[source]}, {protocol.name}")
            numbers = number * worlds + torch.arange(worlds)
            recording = recorders[source].record(protocol, numbers, _generator(seed, protocol, number), display.advance)
            store.save(source, protocol.name, number, digest(recording, protocol, scene.matcher, clips))


def collect(store: ChunkStore, source: str, protocol: Protocol, trajectories: int) -> tuple[Digest, int]:
    """The digests of all trajectories without those that diverged, and how many did.

    Raises:
        CommandError: all of them did.
    """
    chunks = range(_chunks(protocol, trajectories, store.size))
    parts = [store.load(source, protocol.name, number) for number in chunks]
    n = protocol.trajectories(trajectories)
    whole = {name: torch.cat([part[name] for part in parts])[:n] for name in parts[0]}
    healed = whole.pop("healed")
    if healed.all():
        raise CommandError(
            f"trajectories={trajectories}: the simulation diverged in every one of {SOURCES[source]}, "
            f"{protocol.name}; ask for more, or for another seed"
        )
    return {name: value[~healed] for name, value in whole.items()}, int(healed.sum())


def responds(source: str, protocol: Protocol) -> bool:
    """Clips do not feel a push."""
    return not (source == REPLAYED and protocol is PUSHED)


def _chunks(protocol: Protocol, trajectories: int, worlds: int) -> int:
    return -(-protocol.trajectories(trajectories) // worlds)


def _generator(seed: int, protocol: Protocol, number: int) -> torch.Generator:
    """The same for every source, so that policies are told the same and begin alike."""
    words = np.random.SeedSequence([seed, *protocol.name.encode(), number]).generate_state(2)
    return torch.Generator().manual_seed(int(words[0]) << 31 ^ int(words[1]))
