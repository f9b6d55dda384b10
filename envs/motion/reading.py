"""Reading the bytes of a motion file, within bounds."""

import os
from pathlib import Path

from murmillo.envs.errors import MotionError

_MAX_BYTES = 256 * 2**20
"""The longest of ASE's clips has half a megabyte; this would be an hour and a half."""


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
