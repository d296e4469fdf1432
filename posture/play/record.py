"""A session as one HTML file that plays without Python: the frequency rises through the switch of mode, which is named."""

from __future__ import annotations

import contextlib
import io
import logging
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import viser

from posture.config.errors import ConfigError, RunError
from posture.config.play import PlayConfig
from posture.config.published import read_published
from posture.drawing.style import MODE_COLOUR
from posture.play.measures import Measures
from posture.play.pilot import candidates
from posture.play.scene import Scene, look, rgb
from posture.play.server import HOST
from posture.play.session import Session
from posture.play.theory import Office
from posture.storage import run_dir
from posture.storage.atomic import replacing
from posture.theory.stander import segments


def record(config: PlayConfig, path: Path) -> None:
    """Write the ramp of `config.recording` to `path`, and say how large it is.

    Raises ConfigError where `path` or the checkpoint will not do, RunError where the stander falls.
    """
    if path.suffix != ".html":
        raise ConfigError(f"record = {path}: the name must end in .html")
    run_dir.writable(path.parent)
    pilots = candidates(config.ckpt, config.lqr)
    office = Office()
    logging.getLogger("websockets").setLevel(logging.WARNING)
    try:
        session = Session(config, pilots, segments(pilots[0].env), office)
        # Viser records what a server sends; nobody visits this one.
        with contextlib.redirect_stdout(io.StringIO()):
            server = viser.ViserServer(HOST, 0, verbose=False)
        try:
            page = film(session, server, config)
        finally:
            with contextlib.redirect_stdout(io.StringIO()):
                server.stop()
    finally:
        office.close()
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


def film(session: Session, server: viser.ViserServer, config: PlayConfig) -> str:
    """The page. RunError where the stander falls."""
    low, high = config.recording.freq
    look(server.initial_camera)
    scene = Scene(server.scene, session.sole, read_published().table_1.target_height_m)
    session.set(freq=low)
    # The first window is not shown, since no mode has a name before it is full.
    while session.measures().mode == "undefined" and session.time < 60:
        session.step()
    while (theory := session.theory()) is None:
        time.sleep(0.05)
    board = Board(server.scene, low, high, theory.transition)
    recorder = server.get_scene_serializer()
    start, shown = session.time, 0.0
    end = 2 * config.recording.hold + (high - low) / config.ramp_rate
    while (elapsed := session.time - start) < end:
        if session.falls:
            raise RunError(f"the stander fell at {session.knobs.freq:.2f} Hz, {elapsed:.0f} s into the recording")
        if elapsed >= shown:
            scene.show(session.state, session.knobs.tolerance, session.knobs.load)
            measures = session.measures()
            scene.name(measures.mode, f"{measures.mode}, {session.knobs.freq:.2f} Hz")
            board.mark(measures)
            recorder.insert_sleep(1 / config.frames_per_s)
            shown += 1 / config.frames_per_s
        if elapsed >= config.recording.hold and session.knobs.freq < high:
            session.knobs = replace(session.knobs, freq=min(high, session.knobs.freq + config.ramp_rate * session.dt))
        session.step()
    return recorder.as_html()


class Board:
    """Beside the stander: the hip-ankle correlation over frequency, as it comes about."""

    LEFT, WIDTH, MIDDLE, HALF, DEPTH = 0.55, 0.9, 1.05, 0.35, 0.3  # [m]
    APART_HZ = 0.006

    def __init__(self, scene: viser.SceneApi, low: float, high: float, transition: float | None) -> None:
        self._scene, self._low, self._high = scene, low, high
        self._last, self._count = -math.inf, 0
        lines = [((low, -1.0), (low, 1.0)), ((low, 0.0), (high, 0.0)), ((low, -1.0), (high, -1.0))]
        scene.add_line_segments(
            "/board/axes", self._segments(lines), (150, 150, 150), thickness=1.5, thickness_units="screen"
        )
        labels = [
            (low, 1, "+1", "bottom-right"), (low, 0, "0", "center-right"), (low, -1, "-1", "center-right"),
            (low, -1, f"{low:g} Hz", "top-left"), (high, -1, f"{high:g} Hz", "top-right"),
            ((low + high) / 2, 1.25, "hip-ankle correlation over frequency", "bottom-center"),
        ]  # fmt: skip
        if transition is not None and low < transition < high:
            edges = np.linspace(-1, 1, 22).reshape(11, 2)
            dashes = [((transition, float(a)), (transition, float(b))) for a, b in edges]
            scene.add_line_segments(
                "/board/theory", self._segments(dashes), (60, 60, 60), thickness=1.5, thickness_units="screen"
            )
            labels.append((transition, -1, f"theory: {transition:.2f} Hz", "top-center"))
        for i, (freq, r, text, anchor) in enumerate(labels):
            scene.add_label(f"/board/label{i}", text, position=self._place(freq, r), anchor=anchor)  # type: ignore[arg-type]

    def mark(self, measures: Measures) -> None:
        """Add the present point, where it is apart from the last."""
        if math.isnan(measures.r) or measures.freq < self._last + self.APART_HZ:
            return
        self._last, self._count = measures.freq, self._count + 1
        self._scene.add_icosphere(
            f"/board/point{self._count}",
            0.011,
            rgb(MODE_COLOUR[measures.mode]),
            subdivisions=1,
            position=self._place(measures.freq, measures.r),
        )

    def _place(self, freq: float, r: float) -> tuple[float, float, float]:
        share = (freq - self._low) / (self._high - self._low)
        return self.LEFT + self.WIDTH * share, self.DEPTH, self.MIDDLE + self.HALF * r

    def _segments(self, lines: list[tuple[tuple[float, float], tuple[float, float]]]) -> np.ndarray:
        return np.array([[self._place(*a), self._place(*b)] for a, b in lines])
