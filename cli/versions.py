"""What a run was made with: package versions, the commit of the sources, the machine."""

import os
import platform
import subprocess
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

PACKAGES = ("murmillo", "torch", "mujoco", "gymnasium", "numpy", "hydra-core", "safetensors")


def package_versions(names: Sequence[str] = PACKAGES) -> dict[str, str | None]:
    """Installed version by distribution name; None where it is missing."""
    return {name: _version(name) for name in names}


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def git_state() -> dict[str, str | bool | None]:
    """Commit of the sources and whether they differ from it; None where murmillo was not installed from a checkout."""
    room = Path(__file__).parent
    commit = _git(room, "rev-parse", "HEAD")
    # a wheel inside someone else's checkout must not claim that checkout's commit
    if commit is None or _git(room, "ls-files", "--error-unmatch", Path(__file__).name) is None:
        return {"commit": None, "dirty": None}
    return {"commit": commit, "dirty": bool(_git(room, "status", "--porcelain"))}


def _git(folder: Path, *words: str) -> str | None:
    try:
        command = ["git", "-C", str(folder), *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def machine() -> dict[str, Any]:
    """The system, its processor and the cores that this process may use."""
    return {
        "platform": platform.platform(),
        "python": platform.python_version(),
        "processor": processor(),
        "cores": usable_cores(),
        "gpu": gpu(),
    }


def processor() -> str:
    """The processor's name as its maker writes it, or its architecture."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def usable_cores() -> int:
    """Cores that this process may run on, which in a container are fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def gpu() -> str | None:
    """Name of the first CUDA device that torch sees."""
    import torch

    return torch.cuda.get_device_name(0) if torch.cuda.is_available() else None


def describe(threads: int) -> dict[str, Any]:
    """All of it, as `versions.json` holds it; `threads` are those that torch computes with."""
    return {"packages": package_versions(), "git": git_state(), "machine": machine(), "threads": threads}
