"""Sliders and buttons of the page, in a panel of viser: they change the settings of the session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, get_args

import viser

from envs.config import Person, Sex
from posture.config.play import MEASURES, SETTINGS, PlayConfig
from posture.play.session import Session

PAPER = "the paper's"
"""The body that no person's measures apply to, in the list of bodies."""


class Panel:
    """Added to `gui`. What the user does is passed to `command` as an action, which it carries out in the thread of the
    session. The event handlers run in viser's event loop, so that actions keep their order; they touch nothing else."""

    def __init__(
        self, gui: viser.GuiApi, session: Session, config: PlayConfig, command: Callable[[Callable[[], object]], None]
    ) -> None:
        self._session, self._config, self._command = session, config, command
        self.speed = 1.0
        """Simulated time per real time."""
        self._policy = gui.add_dropdown("policy", session.policies, initial_value=session.policy)
        self._on_input(self._policy, self._choose_policy)
        self._shown = {name: self._slider_value(name) for name in SETTINGS}
        self._sliders = {name: self._add_slider(gui, name) for name in SETTINGS}
        self._add_body(gui)
        ramp = f"by {config.ramp_rate:g} Hz/s; press again to stop"
        for label, hint, action in (
            ("ramp up", f"raise the frequency {ramp}", lambda: session.ramp(1)),
            ("ramp down", f"lower the frequency {ramp}", lambda: session.ramp(-1)),
            ("push", f"push the trunk forward for {config.push.duration:g} s", session.push),
            ("reset", "stand upright and at rest; the settings stay", session.reset),
        ):
            self._add_button(gui, label, hint, action)
        force = gui.add_slider("push [N]", 0.0, config.push.limit, 5.0, config.push.force)
        self._on_input(force, lambda value: setattr(session, "push_force", min(max(float(value), 0.0), config.push.limit)))
        self._on_input(gui.add_checkbox("pause", False), lambda value: setattr(session, "paused", value))
        slow = gui.add_checkbox("slow motion", False, hint=f"{config.slow_motion:g} of real time")
        self._on_input(slow, lambda value: setattr(self, "speed", config.slow_motion if value else 1.0))

    def refresh(self) -> None:
        """Update what the session changed itself: sliders in a ramp or with another policy.

        A slider that the user just moved differs from its setting until its action is carried out; it must not be moved
        back. Therefore the comparison is with the value last shown.
        """
        if self._shown_body != self._session.body:
            self._show_body()
        for name, slider in self._sliders.items():
            value = self._slider_value(name)
            low, high, _ = self._session.slider(name)
            if (slider.min, slider.max) != (low, high):
                slider.min, slider.max = low, high
            if self._shown[name] != value:
                self._shown[name] = value
                slider.value = value  # type: ignore[misc]  # viser's type stubs omit the setter

    def _on_input(self, handle: Any, action: Callable[[Any], object]) -> None:
        """Pass the values that the user gives `handle` to `action`, in the thread of the session."""

        async def changed(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:  # not changed by this program
                value = event.target.value
                self._command(lambda: action(value))

        handle.on_update(changed)

    def _add_button(self, gui: viser.GuiApi, label: str, hint: str, action: Callable[[], object]) -> None:
        async def clicked(_: object) -> None:
            self._command(action)

        gui.add_button(label, hint=hint).on_click(clicked)

    def _add_slider(self, gui: viser.GuiApi, name: str) -> viser.GuiSliderHandle[float]:
        low, high, step = self._session.slider(name)
        slider = gui.add_slider(SETTINGS[name], low, high, step, self._slider_value(name))

        def change(value: float) -> None:
            low, high, _ = self._session.slider(name)
            self._session.set(**{name: min(max(float(value), low), high)})
            # A value out of range may have been typed; `refresh` corrects it.
            self._shown[name] = value

        self._on_input(slider, change)
        return slider

    def _slider_value(self, name: str) -> float:
        low, high, step = self._session.slider(name)
        value = getattr(self._session.settings, name)
        return float(min(high, low + step * round((value - low) / step)))

    def _add_body(self, gui: viser.GuiApi) -> None:
        """A list with the paper's body and the two sexes, and sliders of a person's mass and height."""
        self._sex = gui.add_dropdown("body", (PAPER, *get_args(Sex)), hint="or that of a person, by mass and height")
        self._measures = {}
        for name, label in MEASURES.items():
            low, high, step = getattr(self._config.sliders, name)
            middle = low + step * round((high - low) / step / 2)
            self._measures[name] = gui.add_slider(label, low, high, step, middle)
        self._show_body()
        for handle in (self._sex, *self._measures.values()):
            self._on_input(handle, lambda _: self._choose_body())

    def _choose_body(self) -> None:
        """Pass the body that the page shows to the session."""
        ends = {name: getattr(self._config.sliders, name)[:2] for name in MEASURES}
        measures = {name: min(max(float(self._measures[name].value), low), high) for name, (low, high) in ends.items()}
        sex = self._sex.value
        try:
            self._session.set_body(None if sex == PAPER else Person(**measures, sex=sex))
        finally:
            self._show_body()  # the present one if that body is refused

    def _show_body(self) -> None:
        """Show the session's body."""
        self._shown_body = body = self._session.body
        sex = PAPER if body is None else body.sex
        if self._sex.value != sex:
            self._sex.value = sex  # type: ignore[misc]  # as above
        for name, slider in self._measures.items():
            slider.disabled = body is None
            if body is not None and slider.value != getattr(body, name):
                slider.value = getattr(body, name)  # type: ignore[misc]  # as above

    def _choose_policy(self, name: str) -> None:
        try:
            self._session.choose(name)
        finally:
            self._policy.value = self._session.policy  # type: ignore[misc]  # the present one if it cannot be loaded
