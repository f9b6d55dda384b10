"""What this process has taken of the machine's memory."""

import resource
import sys
from pathlib import Path


def peak_memory() -> int:
    """The most that was resident so far [bytes].

    Linux is asked for the program's own peak: what `getrusage` tells there includes the parent's before it started us.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return used if sys.platform == "darwin" else used * 1024  # macOS has bytes, others kilobytes
    (peak,) = (line for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(peak.split()[1]) * 1024
