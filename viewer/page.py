"""The controls on the page: which command each of them gives, and the status line."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import viser

from murmillo.agents.common.blending import Blending
from murmillo.viewer.goals import DIRECTION, FACING, SPEED, TARGET
from murmillo.viewer.latents import FAVOURITES, Latents
from murmillo.viewer.loop import Loop
from murmillo.viewer.scene import Scene
from murmillo.viewer.session import Frame, Session

_CHANCE = "by chance"
_NOBODY = "-"
_PUSHES = {"ahead": 0.0, "left": 0.5 * math.pi, "back": math.pi, "right": -0.5 * math.pi}
"""Angles from straight ahead [rad]."""
_TURN, _FASTER = 15.0, 0.5
"""What a key changes: the direction [degrees], the speed [m/s]."""
_STATUS_FRAMES = 6
"""Frames from one status line to the next, five times a second."""
_SLOW = 0.9
"""Below this part of real time the page says that the machine cannot keep up."""

KEYS = {
    "space": "stand still, or go on",
    "N": "one step while it stands still",
    "R": "a new episode",
    "F": "push it ahead",
    "pageup": "the skill before",
    "pagedown": "the next skill",
    "J": "the goal's direction to the left",
    "L": "the goal's direction to the right",
    "I": "faster",
    "K": "slower",
}
"""What keys do, where the session can; the browser's own W, A, S, D, Q, E and arrows move the camera."""


class Page:
    """Controls for what a session can be told. They hand commands to its loop, and touch nothing themselves."""

    def __init__(self, server: viser.ViserServer, session: Session, loop: Loop, scene: Scene, title: str) -> None:
        """`title` stands at the head of the controls."""
        self._gui, self._session, self._loop, self._scene = server.gui, session, loop, scene
        self._frames = 0
        self._sliders: dict[str, Any] = {}
        self._followed: dict[str, float] = {}
        self._gui.configure_theme(show_share_button=False, show_logo=False, dark_mode=False, brand_color=(140, 26, 26))
        self._gui.set_panel_label(title)
        self._status = self._gui.add_markdown("")
        self._add_time()
        if session.skills:
            self._add_skills(session.skills)
        if session.latents is not None:
            self._add_latents(session.latents)
        if session.adapted is not None:
            self._add_adaptation(session.adapted)
        if not session.plays_freely:
            self._add_goals(server)
        self._add_push()

    def show(self, frame: Frame) -> None:
        """Bring the figures up to date; from the loop's thread."""
        self._frames += 1
        if self._frames % _STATUS_FRAMES == 1 or self._loop.paused:
            self._status.content = status_text(frame, self._loop.pace, self._loop.paused)
            self._follow_goals()

    # --- what every session has ---------------------------------------------------------------------------------------

    def _add_time(self) -> None:
        loop, session, scene = self._loop, self._session, self._scene
        with self._gui.add_folder("Time"):
            pause = self._gui.add_checkbox("Stand still", False)
            self._on_user(pause, loop.pause)
            self._button("One step", loop.step_once, key="N")
            speed = self._gui.add_slider("Speed of time", 0.1, 2.0, 0.1, 1.0, marks=((0.1, "0.1"), (1.0, "1")))
            self._on_user(speed, loop.set_speed)
            self._button("New episode", session.reset, key="R")
            lie = self._gui.add_checkbox("Stay down after a fall", False)
            self._on_user(lie, lambda chosen: setattr(session, "stay_down", chosen))
            follow = self._gui.add_checkbox("Camera follows", True)
            self._on_user(follow, lambda chosen: setattr(scene, "follow", chosen))

        def toggle() -> None:
            pause.value = not loop.paused
            loop.pause(pause.value)

        self._key("space", toggle)

    def _add_push(self) -> None:
        session = self._session
        with self._gui.add_folder("Push for 0.2 s"):
            force = self._gui.add_slider("Newtons", 50, 2000, 50, 500)
            towards = self._gui.add_button_group("Towards", tuple(_PUSHES))
        self._on_user(towards, lambda chosen: session.push(_PUSHES[chosen], force.value))
        self._key("F", lambda: session.push(0.0, force.value))

    # --- what some can be told ----------------------------------------------------------------------------------------

    def _add_skills(self, skills: tuple[str, ...]) -> None:
        names = (_CHANCE, *skills)
        with self._gui.add_folder("Skill"):
            chosen = self._gui.add_dropdown("Commanded", names)

        def command(name: str) -> None:
            self._session.command_skill(None if name == _CHANCE else name)

        def go(by: int) -> None:
            chosen.value = names[(names.index(chosen.value) + by) % len(names)]
            command(chosen.value)

        self._on_user(chosen, command)

        self._key("pageup", lambda: go(-1))
        self._key("pagedown", lambda: go(1))

    def _add_latents(self, latents: Latents) -> None:
        with self._gui.add_folder("Latent"):
            self._button("Draw a new one", latents.draw)
            self._button("Leave it to chance", latents.wander)
            keep = self._button(f"Keep this one (up to {FAVOURITES})", lambda: offer(latents.keep()))
            first = self._gui.add_dropdown("Follow", (_NOBODY, *latents.named))
            second = self._gui.add_dropdown("Blend with", (_NOBODY, *latents.named))
            part = self._gui.add_slider("Part", 0.0, 1.0, 0.01, 0.5, hint="0 is the first, 1 the second")
        keep.hint = "As a favourite, in the lists below"

        def offer(name: str) -> None:
            for choice in (first, second):
                choice.options = (_NOBODY, *latents.named)
            first.value = name

        def follow() -> None:
            if first.value != _NOBODY:
                latents.follow(first.value, None if second.value == _NOBODY else second.value, part.value)

        for control in (first, second, part):
            self._on_user(control, lambda _: follow())

    def _add_adaptation(self, adapted: Blending) -> None:
        ends = "0 is the base, 1 the adaptation" if adapted.adapters == 1 else "0 is the second adaptation, 1 the first"
        with self._gui.add_folder("Adaptation"):
            alpha = self._gui.add_slider("Alpha", 0.0, 1.0, 0.01, adapted.alpha, hint=ends)
        self._on_user(alpha, self._session.blend)

    def _add_goals(self, server: viser.ViserServer) -> None:
        goals = self._session.goals
        with self._gui.add_folder("Goal"):
            if DIRECTION in goals.settable:
                self._slider(DIRECTION, "Move towards (°)", -180.0, 180.0, 5.0, lambda x: goals.move(math.radians(x)))
                self._key("J", lambda: self._turn(_TURN))
                self._key("L", lambda: self._turn(-_TURN))
            if FACING in goals.settable:
                self._slider(FACING, "Face (°)", -180.0, 180.0, 5.0, lambda x: goals.face(math.radians(x)))
            if SPEED in goals.settable:
                self._slider(SPEED, "Speed (m/s)", 0.0, 7.0, 0.1, goals.hasten)
                self._key("I", lambda: self._hasten(_FASTER))
                self._key("K", lambda: self._hasten(-_FASTER))
            if DIRECTION in goals.settable or TARGET in goals.settable:
                self._gui.add_markdown("*Click on the ground to send it there.*")
                self._on_ground_click(server, goals.go_to)
            self._button("Draw a new goal", goals.redraw)

    def _slider(
        self, name: str, label: str, low: float, high: float, step: float, command: Callable[[float], None]
    ) -> None:
        def move(value: float) -> None:
            command(value)
            self._followed[name] = self._holds(name)

        slider = self._sliders[name] = self._gui.add_slider(label, low, high, step, 0.0)
        self._on_user(slider, move)

    def _turn(self, degrees: float) -> None:
        self._session.goals.move(self._angle(DIRECTION) + math.radians(degrees))

    def _hasten(self, by: float) -> None:
        speed = self._session.goals.now(SPEED).item() + by
        self._session.goals.hasten(min(max(speed, 0.0), self._sliders[SPEED].max))

    def _angle(self, name: str) -> float:
        """Of a direction that is a goal now, from the world's x axis [rad]."""
        x, y = self._session.goals.now(name).tolist()
        return math.atan2(y, x)

    def _holds(self, name: str) -> float:
        """What the slider of a goal is to show."""
        slider = self._sliders[name]
        value = self._session.goals.now(name).item() if name == SPEED else math.degrees(self._angle(name))
        return min(max(round(value / slider.step) * slider.step, slider.min), slider.max)

    def _follow_goals(self) -> None:
        """Let the sliders show what anything but themselves has set.

        Else one stays as it is: a user may have moved it further, and the command be on its way.
        """
        for name, slider in self._sliders.items():
            shown = self._holds(name)
            changed = self._followed.get(name) != shown
            self._followed[name] = shown
            if changed and abs(shown - slider.value) > 0.5 * slider.step:
                slider.value = shown

    # --- bindings -----------------------------------------------------------------------------------------------------

    def _button(self, label: str, command: Callable[[], object], key: Any = None) -> viser.GuiButtonHandle:
        button = self._gui.add_button(label, hint=None if key is None else f"Key {key}")
        self._on_user(button, lambda _: command())
        if key is not None:
            self._key(key, command)
        return button

    def _key(self, key: Any, command: Callable[[], object]) -> None:
        async def pressed(_: Any) -> None:
            self._loop.do(command)

        self._gui.add_command(KEYS[key].capitalize(), hotkey=key).on_trigger(pressed)

    def _on_user(self, control: Any, command: Callable[[Any], object]) -> None:
        """Have this done with its value when a user moves a control, but not when the page itself does.

        The value is that of this move, and moves are handed on in their order: what is not asynchronous viser gives to
        threads, which may find another value and overtake each other.
        """

        async def moved(event: Any) -> None:
            if event.client is not None:
                value = event.target.value
                self._loop.do(lambda: command(value))

        pressed = isinstance(control, viser.GuiButtonHandle | viser.GuiButtonGroupHandle)
        (control.on_click if pressed else control.on_update)(moved)

    def _on_ground_click(self, server: viser.ViserServer, command: Callable[[float, float], None]) -> None:
        @server.scene.on_click()
        def _(event: viser.SceneClickEvent) -> None:
            def go() -> None:
                if (place := self._scene.on_ground(event)) is not None:
                    command(*place)

            self._loop.do(go)


def status_text(frame: Frame, pace: float, paused: bool) -> str:
    """The status in Markdown."""
    status = frame.status
    lines = [] if status.skill is None else [f"**{status.skill}**"]
    lines += [
        f"{status.seconds:.1f} s, {status.falls} {'fall' if status.falls == 1 else 'falls'}",
        f"root at {status.height:.2f} m, {status.speed:.1f} m/s",
    ]
    if status.score is not None:
        lines.append(f"like the clips: {status.score:.2f}")
    lines += _terms(status.rewards)
    if paused:
        lines.append("stands still")
    elif pace < _SLOW:
        lines.append(f"**cannot keep up: {pace:.0%} of the speed that was asked for**")
    else:
        lines.append(f"{pace:.0%} of the speed that was asked for")
    return "  \n".join(lines)


def _terms(rewards: dict[str, float]) -> Sequence[str]:
    return [f"{name} reward {value:.2f}" for name, value in rewards.items()]
