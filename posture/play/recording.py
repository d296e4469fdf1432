"""A session as one HTML file that plays without Python: the frequency rises and the mode switches."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import viser

from envs.body.segments import read_segments
from posture.config.errors import RunError
from posture.config.play import PlayConfig
from posture.drawing.style import MODE_COLOUR
from posture.play.measures import Measures
from posture.play.policies import policy_choices
from posture.play.scene import Scene, aim_camera, rgb
from posture.play.server import quiet_server, stop_quietly
from posture.play.session import Session
from posture.play.theory_worker import TheoryWorker
from posture.storage.atomic import replacing

MAX_START_S = 60.0
"""[s] after which the recording starts even if no mode is defined."""


def record(config: PlayConfig, path: Path) -> None:
    """Write the ramp of `config.recording` to `path`, and print its size.

    Raises ConfigError if the checkpoint is not usable, RunError if the stander falls.
    """
    policies = policy_choices(config.ckpt, config.lqr)
    worker = TheoryWorker()
    logging.getLogger("websockets").setLevel(logging.WARNING)
    try:
        session = Session(config, policies, read_segments(policies[0].env), worker)
        server = quiet_server(0)  # viser records what a server sends; no browser is needed
        try:
            page = record_ramp(session, server, config)
        finally:
            stop_quietly(server)
    finally:
        worker.close()
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


def record_ramp(session: Session, server: viser.ViserServer, config: PlayConfig) -> str:
    """The page as HTML. Raises RunError if the stander falls."""
    low, high = config.recording.freq
    aim_camera(server.initial_camera)
    scene = Scene(server.scene, session.sole, session.settings.body)
    session.set(freq=low)
    # The first window is not recorded: the mode is undefined until it is full.
    while session.measures().mode == "undefined" and session.time < MAX_START_S:
        session.step()
    while (theory := session.theory()) is None:
        time.sleep(0.05)
    chart = CorrelationChart(server.scene, low, high, theory.transition)
    recorder = server.get_scene_serializer()
    start, next_frame = session.time, 0.0
    duration = 2 * config.recording.hold + (high - low) / config.ramp_rate
    while (elapsed := session.time - start) < duration:
        if session.falls:
            raise RunError(f"the stander fell at {session.settings.freq:.2f} Hz, {elapsed:.0f} s into the recording")
        if elapsed >= next_frame:
            measures, settings = session.measures(), session.settings
            scene.show(session.state, settings.tolerance, settings.load, session.load_at)
            scene.show_mode(measures.mode, f"{measures.mode}, {settings.freq:.2f} Hz")
            chart.add(measures)
            recorder.insert_sleep(1 / config.frames_per_s)
            next_frame += 1 / config.frames_per_s
        if elapsed >= config.recording.hold and session.settings.freq < high:
            freq = min(high, session.settings.freq + config.ramp_rate * session.dt)
            session.settings = replace(session.settings, freq=freq)
        session.step()
    return recorder.as_html()


class CorrelationChart:
    """Hip-ankle correlation against frequency, drawn in the 3-D scene beside the stander: a recording has no panels."""

    LEFT, WIDTH, MIDDLE, HALF, DEPTH = 0.55, 0.9, 1.05, 0.35, 0.3  # [m]
    MIN_DISTANCE_HZ = 0.006

    def __init__(self, scene: viser.SceneApi, low: float, high: float, transition: float | None) -> None:
        self._scene, self._low, self._high = scene, low, high
        self._last_freq, self._count = -math.inf, 0
        axes = [((low, -1.0), (low, 1.0)), ((low, 0.0), (high, 0.0)), ((low, -1.0), (high, -1.0))]
        self._add_lines("/chart/axes", axes, (150, 150, 150))
        labels = [
            (low, 1, "+1", "bottom-right"), (low, 0, "0", "center-right"), (low, -1, "-1", "center-right"),
            (low, -1, f"{low:g} Hz", "top-left"), (high, -1, f"{high:g} Hz", "top-right"),
            ((low + high) / 2, 1.25, "hip-ankle correlation against frequency", "bottom-center"),
        ]  # fmt: skip
        if transition is not None and low < transition < high:
            ends = np.linspace(-1, 1, 22).reshape(11, 2)
            dashes = [((transition, float(a)), (transition, float(b))) for a, b in ends]
            self._add_lines("/chart/theory", dashes, (60, 60, 60))
            labels.append((transition, -1, f"theory: {transition:.2f} Hz", "top-center"))
        for i, (freq, r, text, anchor) in enumerate(labels):
            scene.add_label(f"/chart/label{i}", text, position=self._place(freq, r), anchor=anchor)  # type: ignore[arg-type]

    def add(self, measures: Measures) -> None:
        """Add a point, unless it is undefined or too close to the last."""
        if math.isnan(measures.r) or measures.freq < self._last_freq + self.MIN_DISTANCE_HZ:
            return
        self._last_freq, self._count = measures.freq, self._count + 1
        self._scene.add_icosphere(
            f"/chart/point{self._count}",
            0.011,
            rgb(MODE_COLOUR[measures.mode]),
            subdivisions=1,
            position=self._place(measures.freq, measures.r),
        )

    def _place(self, freq: float, r: float) -> tuple[float, float, float]:
        share = (freq - self._low) / (self._high - self._low)
        return self.LEFT + self.WIDTH * share, self.DEPTH, self.MIDDLE + self.HALF * r

    def _add_lines(
        self, name: str, lines: list[tuple[tuple[float, float], tuple[float, float]]], colour: tuple[int, int, int]
    ) -> None:
        points = np.array([[self._place(*start), self._place(*end)] for start, end in lines])
        self._scene.add_line_segments(name, points, colour, thickness=1.5, thickness_units="screen")
