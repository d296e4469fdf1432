"""Live plots and numbers of the page, in a panel of viser."""

from __future__ import annotations

import math

import numpy as np
import viser
from viser import uplot

from posture.figures import ANKLE_COLOUR, GREY, HIP_COLOUR, MODE_COLOUR
from posture.play import plots
from posture.play.config import PlayConfig
from posture.play.session import Session
from posture.trajectory import Array

SPAN_S = 10.0
"""[s] of the joint angles that are shown."""
SAMPLES = 200
"""Of each curve."""


class Live:
    """Built into `gui`; `refresh` reads the session."""

    def __init__(self, gui: viser.GuiApi, config: PlayConfig) -> None:
        self._freqs = config.sliders.freq[:2]
        self._headline = gui.add_html("")
        self._numbers = gui.add_html("")
        self._angles = _chart(
            gui, "hip (pink) and ankle (green) [deg]", [("hip", HIP_COLOUR), ("ankle", ANKLE_COLOUR)], (-SPAN_S, 0.0), None
        )
        self._squares = gui.add_html("")
        self._foot = gui.add_html("")
        self._correlation = _chart(
            gui, "running correlation", [("in-phase", MODE_COLOUR["in-phase"]), ("anti-phase", MODE_COLOUR["anti-phase"])],
            (-SPAN_S * 3, 0.0), (-1.05, 1.05),
        )  # fmt: skip
        self._cost = _chart(
            gui, "cost (black), least cost (grey)", [("cost", "#333333"), ("least", GREY)], (-SPAN_S * 3, 0.0), None
        )
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
        time = past[:, 0] - session.time
        r = past[:, 1]
        self._correlation.data = tuple(map(_some, (time, np.where(r > 0, r, np.nan), np.where(r <= 0, r, np.nan))))
        self._cost.data = tuple(map(_some, (time, past[:, 2], past[:, 3])))

    def _remember(self, time: float, r: float, cost: float, least: float) -> None:
        if self._past and time <= self._past[-1][0]:
            return  # paused
        self._past = [row for row in self._past if row[0] > time - 3 * SPAN_S]
        self._past.append((time, r, cost, least))


def _some(values: Array) -> Array:
    """A chart needs two samples to begin with."""
    return values.astype(np.float64) if len(values) > 1 else np.full(2, np.nan)


def _chart(
    gui: viser.GuiApi,
    title: str,
    curves: list[tuple[str, str]],
    across: tuple[float, float],
    up: tuple[float, float] | None,
) -> viser.GuiUplotHandle:
    nothing = tuple(np.full(2, np.nan) for _ in range(len(curves) + 1))
    series = [uplot.Series(label="time"), *(uplot.Series(label=name, stroke=colour, width=2) for name, colour in curves)]
    scales = {"x": uplot.Scale(time=False, range=across), "y": uplot.Scale() if up is None else uplot.Scale(range=up)}
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
