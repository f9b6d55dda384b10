"""Reading motion files and what lies beside them, within bounds."""

import os
from pathlib import Path
from typing import Any

import yaml

from murmillo.envs.errors import MotionError

_MAX_BYTES = 256 * 2**20
"""The longest of ASE's clips has half a megabyte; this would be an hour and a half."""
_MAX_YAML = 2**20


def read_bytes(file: Path) -> bytes:
    """The whole file.

    Raises:
        MotionError: it is missing, cannot be read, or is too large for a clip.
    """
    try:
        with file.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            # as much as it has: what is asked for is allocated first; a device has no size, and no end
            data = b"" if size > _MAX_BYTES else stream.read(size or _MAX_BYTES + 1)
    except OSError as error:
        raise MotionError(f"{file}: cannot be read ({error.strerror or error}); check the path") from None
    if max(size, len(data)) > _MAX_BYTES:
        raise MotionError(f"{file}: is larger than {_MAX_BYTES // 2**20} MB; cut the recording into clips")
    return data


def read_yaml(file: Path, kind: str, form: str) -> Any:
    """The plain data in a YAML file.

    Args:
        kind: what the file is, such as "a dataset", and `form` what it should read, for the errors.

    Raises:
        MotionError: it cannot be read, is too large, or is no YAML.
    """
    data = read_bytes(file)
    if len(data) > _MAX_YAML:
        raise MotionError(f"{file}: is too large for {kind}; it should read {form}")
    try:
        return parse_yaml(data)
    except ValueError:
        raise MotionError(f"{file}: is no YAML; it should read {form}") from None


def parse_yaml(text: str | bytes) -> Any:
    """The plain data in YAML.

    Raises:
        ValueError: it is none.
    """
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, TypeError, LookupError, AttributeError, RecursionError) as error:
        # PyYAML lets through what its own constructors stumble over, such as the IndexError of `!!int ""`
        raise ValueError("no YAML") from error
