"""Sliders and buttons of the page, in a panel of viser: they change the settings of the session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from posture.config.play import SETTINGS, PlayConfig
from posture.play.session import Session


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
        for name, slider in self._sliders.items():
            value = self._slider_value(name)
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
        low, high, step = getattr(self._config.sliders, name)
        slider = gui.add_slider(SETTINGS[name], low, high, step, self._slider_value(name))

        def change(value: float) -> None:
            self._session.set(**{name: min(max(float(value), low), high)})
            # A value out of range may have been typed; `refresh` corrects it.
            self._shown[name] = value

        self._on_input(slider, change)
        return slider

    def _slider_value(self, name: str) -> float:
        low, high, step = getattr(self._config.sliders, name)
        value = getattr(self._session.settings, name)
        return float(min(high, low + step * round((value - low) / step)))

    def _choose_policy(self, name: str) -> None:
        try:
            self._session.choose(name)
        finally:
            self._policy.value = self._session.policy  # type: ignore[misc]  # the present one if it cannot be loaded
