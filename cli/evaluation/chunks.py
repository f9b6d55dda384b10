"""Digests on the disk, a file a chunk, so that long work can be stopped at any moment and taken up again."""

import os
import shutil
from pathlib import Path
from typing import Any

import safetensors.torch
from torch import Tensor

from murmillo.cli import runs
from murmillo.cli.evaluation.digests import Digest

_KEY = "key.json"


class ChunkStore:
    """A folder of chunks that were all made with the same key; a store with another key begins empty."""

    def __init__(self, folder: Path, size: int, key: dict[str, Any]) -> None:
        """
        Args:
            size: trajectories in a chunk.
            key: JSON values, everything else that the content of a chunk depends on beside its own name.
        """
        self.folder, self.size = folder, size
        key = {"size": size, **key}
        if runs.read_json(folder / _KEY) != key:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            runs.write_json(folder / _KEY, key)

    def has(self, source: str, protocol: str, number: int) -> bool:
        return self._path(source, protocol, number).is_file()

    def save(self, source: str, protocol: str, number: int, chunk: Digest) -> None:
        """Write a chunk whole or not at all."""
        path = self._path(source, protocol, number)
        path.parent.mkdir(exist_ok=True)
        beside = path.with_name(f".{path.name}.part")
        safetensors.torch.save_file({name: value.contiguous() for name, value in chunk.items()}, beside)
        os.replace(beside, path)

    def load(self, source: str, protocol: str, number: int) -> dict[str, Tensor]:
        return safetensors.torch.load_file(self._path(source, protocol, number))

    def _path(self, source: str, protocol: str, number: int) -> Path:
        return self.folder / source / f"{protocol}-{number:04}.safetensors"
