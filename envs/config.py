"""What `gymnasium.make` takes beside the id."""

from dataclasses import dataclass, field
from typing import Literal

from gymnasium.vector import AutoresetMode

from murmillo.envs.bodies import BodyConfig
from murmillo.envs.errors import SuiteError
from murmillo.envs.falls import FallConfig
from murmillo.envs.features import FEATURES
from murmillo.envs.physics import ENGINES
from murmillo.envs.starts import StartConfig
from murmillo.envs.tasks.arguments import check_range
from murmillo.envs.tasks.pushes import PushConfig
from murmillo.envs.terrain import TerrainConfig
from murmillo.envs.tracking import TrackingConfig


@dataclass
class EnvConfig:
    """The settings of an environment.

    Attributes:
        motions: "builtin", a folder of clips or one file.
        clips: names of those of them that are used, or patterns such as "walk_*"; empty for all.
        character: an MJCF of `assets/mjcf`.
        body: how its body differs from the MJCF: a shape, factors on links, locked joints.
        features: how the character is seen: "character", the state of ASE, CALM and C.ASE, or "links", AdaptNet's
            (`murmillo.envs.features`).
        window: frames that the observation `window` holds, the newest last; 1 leaves it out.
        episode_steps: control steps until an episode is truncated (300 steps are 10 s).
        residual_force: scale of the skeletal residual forces [N] (C.ASE section 3.1); 0 takes them out of the action.
        residual_reward: form of their regularising reward (`ResidualForces.reward`), "sum" (paper) or "mean" (code).
        autoreset: gymnasium's autoreset mode of the vector environment.
        physics: "cpu", MuJoCo's pool of simulations, or "warp", MuJoCo Warp (extra `gpu`; docs/gpu.md).
        device: where observations, rewards and demonstrations are: "auto" is the CPU, of "warp" the first GPU; "cuda:1"
            and the like; "cpu", of "warp" its own slow CPU device. With "cpu" physics it may be a GPU all the same, to
            and from which each step is copied once; all of "warp" is on it.
        tensors: steps and resets give torch tensors on the device, and take them, in place of numpy arrays.
        contacts, constraints: that a world of "warp" has room for, the first on average; 0 measures both.
        threads: CPU threads of the "cpu" physics; 0 takes every CPU.
        camera, width, height: of the frames of `render_mode="rgb_array"`.
        friction: range of the ground's friction, drawn for each episode; None is the MJCF's, which is 1.
        terrain: the ground's shape; what is not flat is observed too.
        pushes: pushes at random, whatever the task.
        fall: what ends an episode.
        starts: how one begins.
        tracking: a clip to follow, moment by moment.
    """

    motions: str = "builtin"
    clips: tuple[str, ...] = ()
    character: str = "sword_shield"
    body: BodyConfig = field(default_factory=BodyConfig)
    features: Literal["character", "links"] = "character"
    window: int = 1
    episode_steps: int = 300
    residual_force: float = 0.0
    residual_reward: Literal["sum", "mean"] = "sum"
    autoreset: Literal["same_step", "next_step", "disabled"] = "same_step"
    physics: Literal["cpu", "warp"] = "cpu"
    device: str = "auto"
    tensors: bool = False
    contacts: int = 0
    constraints: int = 0
    threads: int = 0
    camera: str = "track"
    width: int = 640
    height: int = 480
    friction: tuple[float, float] | None = None
    terrain: TerrainConfig = field(default_factory=TerrainConfig)
    pushes: PushConfig = field(default_factory=PushConfig)
    fall: FallConfig = field(default_factory=FallConfig)
    starts: StartConfig = field(default_factory=StartConfig)
    tracking: TrackingConfig = field(default_factory=TrackingConfig)


def check_config(config: EnvConfig, render_mode: str | None, modes: list[str]) -> None:
    """Refuse what cannot be.

    Args:
        modes: the render modes that there are.

    Raises:
        SuiteError: naming the setting, what was wrong and what would be right.
    """
    for name, least in (("window", 1), ("episode_steps", 1), ("residual_force", 0), ("width", 1), ("height", 1)):
        if getattr(config, name) < least:
            raise SuiteError(f"{name}={getattr(config, name)}: needs at least {least}")
    if config.friction is not None:
        check_range("friction", config.friction, least=0.0, of="")
    config.tracking.check()
    if config.tracking.follow and config.features != "character":
        raise SuiteError(f"tracking.follow=true: needs features=character, not {config.features}")
    for name, value, known in (
        ("autoreset", config.autoreset, [mode.name.lower() for mode in AutoresetMode]),
        ("physics", config.physics, list(ENGINES)),
        ("features", config.features, list(FEATURES)),
        ("residual_reward", config.residual_reward, ["sum", "mean"]),
        ("fall.contact", config.fall.contact, ["ground", "any"]),
        ("render_mode", render_mode, [None, *modes]),
    ):
        if value not in known:
            raise SuiteError(f"{name}={value}: no such choice; there are: {', '.join(filter(None, known))}")
