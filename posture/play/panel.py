"""Sliders and buttons of the page, in a panel of viser: they change the settings of the session."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager

import viser

from posture.config.errors import ConfigError
from posture.config.play import SETTINGS, PlayConfig
from posture.play.session import Session

LABELS = {
    "freq": "frequency [Hz]",
    "hip_k": "hip stiffness [Nm/rad]",
    "ankle_k": "ankle stiffness [Nm/rad]",
    "load": "load [kg]",
    "amplitude": "amplitude [m]",
    "tolerance": "tolerance [m]",
}


class Panel:
    """Added to `gui`. It changes the session only while it holds `lock`; `show_error` displays a message."""

    def __init__(
        self,
        gui: viser.GuiApi,
        session: Session,
        config: PlayConfig,
        policies: list[str],
        lock: AbstractContextManager[object],
        show_error: Callable[[str], object],
    ) -> None:
        self._session, self._config, self._lock, self._show_error = session, config, lock, show_error
        self.speed = 1.0
        """Simulated time per real time."""
        self._policy = gui.add_dropdown("policy", policies, initial_value=session.policy)
        self._policy.on_update(lambda event: self._choose_policy() if event.client is not None else None)
        self._shown = {name: self._slider_value(name) for name in SETTINGS}
        self._sliders = {name: self._add_slider(gui, name) for name in SETTINGS}
        ramp = f"by {config.ramp_rate:g} Hz/s; press again to stop"
        for label, hint, action in (
            ("ramp up", f"raise the frequency {ramp}", lambda: session.ramp(1)),
            ("ramp down", f"lower the frequency {ramp}", lambda: session.ramp(-1)),
            ("push", f"push the trunk forward for {config.push.duration:g} s", session.push),
            ("reset", "stand upright and at rest; the settings stay", session.reset),
        ):
            gui.add_button(label, hint=hint).on_click(self._locked(action))
        force = gui.add_slider("push [N]", 0.0, config.push.limit, 5.0, config.push.force)
        force.on_update(lambda _: setattr(session, "push_force", force.value))
        pause = gui.add_checkbox("pause", False)
        pause.on_update(lambda _: setattr(session, "paused", pause.value))
        slow = gui.add_checkbox("slow motion", False, hint=f"{config.slow_motion:g} of real time")
        slow.on_update(lambda _: setattr(self, "speed", config.slow_motion if slow.value else 1.0))

    def refresh(self) -> None:
        """Update the sliders where the session changed a setting itself: in a ramp, or with another policy.

        A slider that the user just moved differs from its setting until its callback has run; it must not be moved back.
        Therefore the comparison is with the value last shown.
        """
        for name, slider in self._sliders.items():
            value = self._slider_value(name)
            if self._shown[name] != value:
                self._shown[name] = value
                slider.value = value  # type: ignore[misc]  # viser's type stubs omit the setter

    def _add_slider(self, gui: viser.GuiApi, name: str) -> viser.GuiSliderHandle[float]:
        low, high, step = getattr(self._config.sliders, name)
        slider = gui.add_slider(LABELS[name], low, high, step, self._slider_value(name))

        def changed(event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
            if event.client is None:
                return  # changed by `refresh`
            with self._lock:
                self._session.set(**{name: min(max(float(slider.value), low), high)})
                if slider.value != self._slider_value(name):
                    self._shown[name] = math.nan  # a value out of range was typed; `refresh` corrects it

        slider.on_update(changed)
        return slider

    def _slider_value(self, name: str) -> float:
        low, high, step = getattr(self._config.sliders, name)
        value = getattr(self._session.settings, name)
        return float(min(high, low + step * round((value - low) / step)))

    def _locked(self, action: Callable[[], None]) -> Callable[[object], None]:
        def run(_: object) -> None:
            with self._lock:
                action()

        return run

    def _choose_policy(self) -> None:
        with self._lock:
            try:
                self._session.choose(self._policy.value)
            except ConfigError as error:
                self._policy.value = self._session.policy  # type: ignore[misc]
                self._show_error(str(error))
