"""Which OpenGL draws on this machine without a screen. MuJoCo reads `MUJOCO_GL` once, when it is imported."""

import os
import platform
import subprocess
import sys

BACKENDS = {"Linux": ("egl", "osmesa"), "Darwin": ("cgl",), "Windows": ("wgl",)}

# a lit sphere on black: a frame of one colour means that nothing was drawn
_DRAW = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><light pos="0 0 3"/><geom type="sphere" size=".1"/></worldbody></mujoco>')
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
renderer = mujoco.Renderer(model, 32, 32)
renderer.update_scene(data)
assert renderer.render().std() > 0, "the frame is empty"
print("drawn")
"""


def candidates() -> tuple[str, ...]:
    """Back ends to try: what the user has set in `MUJOCO_GL`, and nothing else, or this system's own in order."""
    chosen = os.environ.get("MUJOCO_GL")
    return (chosen,) if chosen else BACKENDS.get(platform.system(), ())


def why_not(backend: str, timeout_s: float = 60.0) -> str | None:
    """None where the back end draws a frame, else the reason. Tried in another process: a bad driver may crash it."""
    environment = {**os.environ, "MUJOCO_GL": backend}
    try:
        done = subprocess.run(
            [sys.executable, "-c", _DRAW],
            env=environment,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"no frame within {timeout_s:.0f} s"
    if "drawn" in done.stdout:  # the exit status says nothing: some drivers fail on their way out
        return None
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    return lines[-1].strip() if lines else f"ended with status {done.returncode}"


def choose() -> str | None:
    """Set `MUJOCO_GL` to the first back end that draws and return it; None, and switched off, where none does.

    To be called before MuJoCo is imported.
    """
    for backend in candidates():
        if why_not(backend) is None:
            os.environ["MUJOCO_GL"] = backend
            return backend
    os.environ["MUJOCO_GL"] = "off"
    return None


def no_gl_message(tried: tuple[str, ...]) -> str:
    """The one line for a machine that cannot draw by any of the back ends `tried`, the `candidates` before `choose`."""
    return (
        f"no OpenGL draws here without a screen (tried {', '.join(tried) or 'none, as none is known here'}): "
        "on Debian or Ubuntu `apt-get install libegl1 libosmesa6` brings one; `murmillo doctor` tries them again"
    )
