"""`murmillo doctor`: whether murmillo can work on this machine, and how fast."""

import platform
import time
from collections.abc import Iterator

from murmillo.cli import gl, versions
from murmillo.cli.errors import CommandError

HELP = """\
murmillo doctor: look at this machine

Prints the versions of what murmillo is built on, which OpenGL back ends draw without a screen, the cores, the GPU and
a two-second speed test of the environment. Exit status 0 where training can work; pictures are a bonus.
"""

WORLDS = 256
SECONDS = 2.0


def run(words: list[str]) -> int:
    """Print the table; 0 where the environment steps, 1 where it does not."""
    if words:
        raise CommandError(f"doctor takes no settings, but got {words[0]!r}; run `murmillo doctor`")
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, show_header=False, pad_edge=False)
    usable = True
    for name, text, is_well in findings():
        table.add_row(name, text, "" if is_well is None else "ok" if is_well else "-")
        usable = usable and not (name == "environment" and not is_well)
    Console(soft_wrap=True, highlight=False).print(table)
    print("murmillo can train here" if usable else "murmillo cannot train here: the environment does not step")
    return 0 if usable else 1


def findings() -> Iterator[tuple[str, str, bool | None]]:
    """Rows of the table: what, what was found, and whether it is well (None where that is no question)."""
    for name, found in {"python": platform.python_version(), **versions.package_versions()}.items():
        yield name, found or "not installed", found is not None
    yield "system", platform.platform(), None
    yield "processor", f"{versions.processor()}, {versions.usable_cores()} cores", None
    for backend in gl.candidates():
        reason = gl.why_not(backend)
        yield f"OpenGL {backend}", reason or "draws a frame without a screen", reason is None
    gpu = versions.gpu()
    yield "GPU", gpu or "none that torch can use; training runs on the processor", None
    yield "physics=warp", *warp()
    try:
        yield "environment", f"{environment_speed():,.0f} control steps/s over {WORLDS} worlds", True
    except Exception as error:  # the doctor reports whatever goes wrong
        yield "environment", f"{type(error).__name__}: {error}", False


def warp() -> tuple[str, bool]:
    """Whether MuJoCo Warp is there and has a GPU."""
    try:
        import mujoco_warp  # noqa: F401 it is to import
        import warp
    except ImportError as error:
        return f"{error}; install it with pip install 'murmillo[gpu]'", False
    warp.config.log_level = warp.LOG_ERROR
    gpus = [f"{gpu.alias} {gpu.name}" for gpu in warp.get_cuda_devices()]
    return ", ".join(gpus) or "installed, but without a GPU: device=cpu is for tests", bool(gpus)


def environment_speed() -> float:
    """Control steps a second, summed over the worlds, of the whole environment with random actions."""
    from murmillo.envs.vector import HumanoidVectorEnv

    env = HumanoidVectorEnv(WORLDS)
    env.action_space.seed(0)
    env.reset(seed=0)
    action = env.action_space.sample()
    env.step(action)
    steps, start = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - start) < SECONDS:
        env.step(action)
        steps += WORLDS
    env.close()
    return steps / elapsed
