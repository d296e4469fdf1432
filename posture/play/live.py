"""Live plots and numbers of the page, in a panel of viser."""

from __future__ import annotations

import math

import numpy as np
import viser
from viser import uplot

from posture.analysis.trajectory import Array
from posture.config.play import PlayConfig
from posture.drawing.style import ANKLE_COLOUR, GREY, HIP_COLOUR, MODE_COLOUR
from posture.play import plots
from posture.play.session import Session

SPAN_S = 10.0
"""[s] of the joint angles that are shown."""
STRIP_S = 30.0
"""[s] of correlation and cost."""
SAMPLES = 200
"""Of each curve."""


class Live:
    """Built into `gui`; `refresh` reads the session."""

    def __init__(self, gui: viser.GuiApi, config: PlayConfig) -> None:
        self._freqs = config.sliders.freq[:2]
        self._headline = gui.add_html("")
        self._numbers = gui.add_html("")
        joints = [("hip", HIP_COLOUR), ("ankle", ANKLE_COLOUR)]
        self._angles = _chart(gui, "hip (pink) and ankle (green) [deg]", joints, (-SPAN_S, 0.0))
        self._squares = gui.add_html("")
        self._foot = gui.add_html("")
        self._strips = gui.add_html("")
        self._past: list[tuple[float, float, float, float]] = []  # time, correlation, cost, least cost

    def refresh(self, session: Session) -> None:
        """Draw what the session has by now."""
        measures, theory, history = session.measures(), session.theory(), session.history
        self._headline.content = plots.headline(
            measures, session.fallen, session.paused, session.ramping, session.knobs.freq
        )
        self._numbers.content = plots.numbers(measures, theory, session.note, session.falls, session.crept)
        cycle = math.ceil(1 / (session.knobs.freq * session.dt))
        transition = None if theory is None else theory.transition
        self._squares.content = plots.row(
            plots.angle_angle(history.last("hip", cycle), history.last("ankle", cycle), measures.mode),
            plots.hysteresis(tuple(session.trail.points), transition, self._freqs),
        )
        self._foot.content = plots.row(plots.foot(history.last("cop", cycle), session.sole))
        count = round(SPAN_S / session.dt)
        time = history.last("time", count) - session.time
        every = max(1, count // SAMPLES)
        angles = [np.degrees(history.last(joint, count)) for joint in ("hip", "ankle")]
        self._angles.data = tuple(_some(x[::-every][::-1]) for x in (time, *angles))
        self._remember(session.time, measures.r, measures.cost, math.nan if theory is None else theory.at(measures.freq))
        past = np.array(self._past)
        ago, r = past[:, 0] - session.time, past[:, 1]
        modes = [
            (np.where(r > 0, r, np.nan), MODE_COLOUR["in-phase"]),
            (np.where(r < 0, r, np.nan), MODE_COLOUR["anti-phase"]),
        ]
        costs = [(past[:, 3], GREY), (past[:, 2], "#333333")]
        self._strips.content = plots.row(
            plots.strip("running correlation", ago, modes, STRIP_S, (-1.0, 1.0)),
            plots.strip("cost (black) and least cost (grey)", ago, costs, STRIP_S, None),
        )

    def _remember(self, time: float, r: float, cost: float, least: float) -> None:
        if self._past and time <= self._past[-1][0]:
            return  # paused
        self._past = [row for row in self._past if row[0] > time - STRIP_S]
        self._past.append((time, r, cost, least))


def _some(values: Array) -> Array:
    """A chart needs two samples to begin with."""
    return values.astype(np.float64) if len(values) > 1 else np.full(2, np.nan)


def _chart(
    gui: viser.GuiApi,
    title: str,
    curves: list[tuple[str, str]],
    across: tuple[float, float],
) -> viser.GuiUplotHandle:
    nothing = tuple(np.full(2, np.nan) for _ in range(len(curves) + 1))
    series = [uplot.Series(label="time"), *(uplot.Series(label=name, stroke=colour, width=2) for name, colour in curves)]
    scales = {"x": uplot.Scale(time=False, range=across), "y": uplot.Scale()}
    return gui.add_uplot(
        nothing,
        tuple(series),
        title=title,
        scales=scales,
        axes=(uplot.Axis(size=30, font="11px system-ui"), uplot.Axis(size=42, font="11px system-ui")),
        legend=uplot.Legend(show=False),
        height=125,
        padding=(6, 14, 0, 0),
    )
