"""Sliders and buttons of the page, in a panel of viser: each turns a knob of the session."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager

import viser

from posture.config.errors import ConfigError
from posture.config.play import KNOBS, PlayConfig
from posture.play.session import Session

LABELS = {
    "freq": "frequency [Hz]",
    "hip_k": "hip stiffness [Nm/rad]",
    "ankle_k": "ankle stiffness [Nm/rad]",
    "load": "load [kg]",
    "amplitude": "amplitude [m]",
    "tolerance": "tolerance [m]",
}


class Controls:
    """Built into `gui`. Whatever it does to the session, it does within `lock`."""

    def __init__(
        self,
        gui: viser.GuiApi,
        session: Session,
        config: PlayConfig,
        pilots: list[str],
        lock: AbstractContextManager[object],
        refuse: Callable[[str], object],
    ) -> None:
        self._session, self._config, self._lock, self._refuse = session, config, lock, refuse
        self.speed = 1.0
        """Share of real time."""
        self._pilot = gui.add_dropdown("policy", pilots, initial_value=session.pilot)
        self._pilot.on_update(lambda event: self._choose() if event.client is not None else None)
        self._shown = {name: self._on_slider(name) for name in KNOBS}
        self._sliders = {name: self._slider(gui, name) for name in KNOBS}
        for label, hint, act in (
            ("ramp up", f"the frequency rises by {config.ramp_rate:g} Hz/s; again: hold it", lambda: session.ramp(1)),
            ("ramp down", f"the frequency falls by {config.ramp_rate:g} Hz/s; again: hold it", lambda: session.ramp(-1)),
            ("push", f"forward on the trunk, for {config.push.duration:g} s", session.push),
            ("reset", "upright and at rest; the sliders stay", session.reset),
        ):
            self._button(gui, label, hint, act)
        self._force = gui.add_slider("push [N]", 0.0, config.push.limit, 5.0, config.push.force)
        self._force.on_update(lambda _: setattr(session, "force", self._force.value))
        self._pause = gui.add_checkbox("pause", False)
        self._pause.on_update(lambda _: setattr(session, "paused", self._pause.value))
        self._slow = gui.add_checkbox("slow motion", False, hint=f"{config.slow_motion:g} of real time")
        self._slow.on_update(lambda _: setattr(self, "speed", config.slow_motion if self._slow.value else 1.0))

    def follow(self) -> None:
        """Let the sliders show what the session has by itself: a ramp, or the body of another policy.

        Compared with what they showed, not with where they are: a slider that was just moved is not to be put back before
        its knob is turned.
        """
        for name, slider in self._sliders.items():
            value = self._on_slider(name)
            if self._shown[name] != value:
                self._shown[name] = value
                slider.value = value  # type: ignore[misc]  # viser declares less than it does

    def _slider(self, gui: viser.GuiApi, name: str) -> viser.GuiSliderHandle[float]:
        low, high, step = getattr(self._config.sliders, name)
        slider = gui.add_slider(LABELS[name], low, high, step, self._on_slider(name))

        def turned(event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
            if event.client is None:
                return  # by `follow`
            with self._lock:
                self._session.set(**{name: min(max(float(slider.value), low), high)})
                if slider.value != self._on_slider(name):
                    self._shown[name] = math.nan  # typed beyond the range: `follow` puts it right

        slider.on_update(turned)
        return slider

    def _on_slider(self, name: str) -> float:
        low, high, step = getattr(self._config.sliders, name)
        value = getattr(self._session.knobs, name)
        return float(min(high, low + step * round((value - low) / step)))

    def _button(self, gui: viser.GuiApi, label: str, hint: str, act: Callable[[], None]) -> None:
        def pressed(_: object) -> None:
            with self._lock:
                act()

        gui.add_button(label, hint=hint).on_click(pressed)

    def _choose(self) -> None:
        with self._lock:
            try:
                self._session.choose(self._pilot.value)
            except ConfigError as error:
                self._pilot.value = self._session.pilot  # type: ignore[misc]
                self._refuse(str(error))
