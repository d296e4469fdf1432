"""One visitor's page: their own session, stepped in real time by a thread of its own."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Sequence

import torch
import viser

from envs.body.segments import Segments
from posture.config.play import PlayConfig
from posture.config.published import read_published
from posture.play.controls import Controls
from posture.play.live import Live
from posture.play.pilot import Candidate
from posture.play.scene import Scene, look
from posture.play.session import Session
from posture.play.theory import Office

LATE_S = 0.25
"""What a slow machine lags behind by more than this is let go, rather than caught up with."""


class Visit(threading.Thread):
    """session: what is played with. steps, frames: how many were made, for measurements."""

    def __init__(
        self, client: viser.ClientHandle, config: PlayConfig, pilots: Sequence[Candidate], body: Segments, office: Office
    ) -> None:
        super().__init__(daemon=True)
        self._client, self._config = client, config
        self.session = Session(config, pilots, body, office)
        self.steps = self.frames = 0
        self._lock, self._over = threading.Lock(), threading.Event()
        gui = client.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(0, 114, 178))
        gui.set_panel_label("posture")
        panel = gui.add_panel()
        with panel.add_tab("what it does"):
            self._live = Live(gui, config)
        panel.dock_left()
        panel.set_width(400)
        self._controls = Controls(
            gui,
            self.session,
            config,
            [pilot.name for pilot in pilots],
            self._lock,
            lambda text: client.add_notification("not possible", text, color="red"),
        )
        gui.main_panel.dock_right()
        gui.main_panel.set_width(310)
        look(client.camera)
        self._scene = Scene(client.scene, self.session.sole, read_published().table_1.target_height_m)

    def leave(self) -> None:
        """End the visit."""
        self._over.set()

    def run(self) -> None:
        """Step, show, and draw until the visitor leaves."""
        torch.set_num_threads(1)
        try:
            self._play()
        except Exception as error:
            if not self._over.is_set():
                traceback.print_exc()
                self._client.add_notification("stopped", f"{type(error).__name__}: {error}; reload the page", color="red")

    def _play(self) -> None:
        session, config = self.session, self._config
        started = shown = drawn = time.monotonic()
        owed = 0.0  # [s] of the session
        while not self._over.is_set():
            now = time.monotonic()
            owed = min(owed + (now - started) * self._controls.speed, LATE_S)
            started = now
            with self._lock:
                while owed >= session.dt:
                    session.step()
                    owed -= session.dt
                    self.steps += not session.paused
                if now >= shown:
                    shown = max(shown + 1 / config.frames_per_s, now - LATE_S)
                    self._show()
                if now >= drawn:
                    drawn = max(drawn + 1 / config.plots_per_s, now)
                    self._draw()
            due = min(shown, drawn, now + (session.dt - owed) / self._controls.speed)
            self._over.wait(max(0.001, due - time.monotonic()))

    def _show(self) -> None:
        knobs = self.session.knobs
        with self._client.atomic():
            self._scene.show(self.session.state, knobs.tolerance, knobs.load)
        self.frames += 1

    def _draw(self) -> None:
        session = self.session
        self._live.refresh(session)
        measures = session.measures()
        self._scene.name(measures.mode, "fallen" if session.fallen else f"{measures.mode}, {session.knobs.freq:.2f} Hz")
        self._controls.follow()
