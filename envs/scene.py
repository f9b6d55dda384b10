"""The world that is simulated: the character, and what a task puts beside it."""

from collections.abc import Sequence

import mujoco
from torch import Tensor

from murmillo.envs.character import Character, SpecEdit, without_visuals
from murmillo.envs.errors import SuiteError

_HIT = "hit_"  # contact sensors of this prefix hold a prop's force on a body
_GROUND = "ground_"

_ASIDE = 50.0
"""[m] How far ahead of the world's origin props begin."""
_APART = 10.0
"""[m] How far they are there from the ground and from each other."""


class Scene:
    """One compiled model: the character's bodies, joints and sensors first, props behind them.

    A prop is a body of its own on a free joint, as `add_box` makes it.

    Attributes:
        character: it; its own model has no props.
        model: what is simulated, without visual geoms.
        props: names of the P props.
    """

    def __init__(self, character: Character, edit: SpecEdit | None = None) -> None:
        """`edit` adds props, terrain and the like to the character's spec.

        Raises:
            SuiteError: the edit changed the character's own part, or added a moving body that is no prop.
        """
        self.character = character
        self._spec = character.spec()
        if edit is not None:
            edit(self._spec)
        for sensor in self._spec.sensors:
            if sensor.name.startswith(_HIT):
                sensor.nsample = character.substeps
        self.model = without_visuals(self._spec).compile()
        first = len(character.bodies) + 1
        own = tuple(self.model.body(i).name for i in range(1, min(first, self.model.nbody)))
        if own != character.bodies or self.model.nu != character.model.nu:
            raise SuiteError("scene: the edit changed the character's bodies or actuators; edit the character itself")
        self.props = tuple(self.model.body(i).name for i in range(first, self.model.nbody))
        if self.model.nq != character.model.nq + 7 * len(self.props):
            raise SuiteError(f"scene: props ({', '.join(self.props)}) need one free joint each; see add_box")
        self._hit_start = self._find_hits()
        if self.props:
            # each prop is a tree of its own; what does not touch is solved for apart, which is quicker
            self.model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_ISLAND)

    @property
    def feels_everything(self) -> bool:
        """Whether the bodies feel all that touches them as if it were the ground (`count_every_contact`)."""
        sensor = self.model.sensor(_GROUND + self.character.bodies[0])
        return int(sensor.reftype[0]) == mujoco.mjtObj.mjOBJ_UNKNOWN

    def render_model(self, offscreen: tuple[int, int] | None = None) -> mujoco.MjModel:
        """The model with its visual geoms, for pictures; its qpos layout is that of `model`."""
        spec = self._spec.copy()
        if offscreen is not None:
            spec.visual.global_.offwidth, spec.visual.global_.offheight = offscreen
        return spec.compile()

    def hits(self, history: Tensor) -> Tensor:
        """[N, P, B, S, 3] the props' forces on the bodies in the last S substeps, those of a control step [N].

        Args:
            history: [N, H] MuJoCo's sensor history: for each prop and body two words of its own, S times, S forces.
        """
        samples, bodies = self.character.substeps, len(self.character.bodies)
        width = 2 + 4 * samples
        end = self._hit_start + len(self.props) * bodies * width
        buffers = history[:, self._hit_start : end].unflatten(1, (len(self.props), bodies, width))
        return buffers[..., 2 + samples :].unflatten(-1, (samples, 3))

    def _find_hits(self) -> int:
        names = [self.model.sensor(i).name for i in range(self.model.nsensor)]
        wanted = [f"{_HIT}{prop}_{body}" for prop in self.props for body in self.character.bodies]
        if [name for name in names if name.startswith(_HIT)] != wanted:
            raise SuiteError(f"scene: needs one contact sensor {_HIT}<prop>_<body> a body for each prop; see add_box")
        return int(self.model.sensor_historyadr[names.index(wanted[0])]) if wanted else 0


def aside(prop: int) -> tuple[float, float, float]:
    """Where the prop of this index begins [m]: far from the character and in the air, where it touches nothing."""
    return (_ASIDE, _APART * prop, _APART)


def slippery(spec: mujoco.MjSpec) -> None:
    """Edit by which the ground's friction is that of its contacts, however rough the body that touches it."""
    for geom in spec.worldbody.geoms:
        geom.priority = 1


def add_box(
    spec: mujoco.MjSpec,
    name: str,
    size: Sequence[float],
    mass: float,
    rgba: tuple[float, float, float, float] = (0.55, 0.38, 0.22, 1.0),
    margin: float = 0.0,
) -> None:
    """Add a free box whose hits on each of the character's bodies are felt (`State.hit_force_w`).

    Args:
        spec: the character's; its bodies must all be there already.
        name: of the prop.
        size: lengths of its edges [m].
        mass: [kg].
        rgba: its colour.
        margin: distance [m] from bodies at which it is already stopped; at 40 m/s it moves 0.33 m a substep, and would
            else pass through what is thinner. It lies on the ground all the same.
    """
    # one a body, in the bodies' order
    patterns = {s.name.removeprefix(_GROUND): s for s in spec.sensors if s.name.startswith(_GROUND)}
    box = spec.worldbody.add_body(name=name, pos=aside(len(spec.worldbody.bodies) - 1))
    box.add_freejoint(name=name)
    half = [0.5 * edge for edge in size]
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, name=name, size=half, mass=mass, rgba=rgba, condim=3, margin=margin)
    if margin:
        for ground in spec.worldbody.geoms:
            spec.add_pair(geomname1=ground.name, geomname2=name, condim=3, margin=0.0)
    for body, pattern in patterns.items():
        spec.add_sensor(
            name=f"{_HIT}{name}_{body}",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            objname=name,
            reftype=mujoco.mjtObj.mjOBJ_BODY,
            refname=body,
            intprm=pattern.intprm,
        )
