"""Numbers and charts of the page, in a panel of viser. Numbers are small HTML, charts are viser's uPlot.

uPlot draws a line across nan, does not find the range of values with nan, and wants ascending x. So curves with gaps and
closed curves are drawn as points, and their ranges are given.
"""

from __future__ import annotations

import math
from html import escape

import numpy as np
import viser
from viser import uplot

from posture.analysis.trajectory import Array
from posture.config.play import PlayConfig
from posture.drawing.style import ANKLE_COLOUR, BLUE, FALL_COLOUR, GREY, HIP_COLOUR, MODE_COLOUR, ORANGE
from posture.play.measures import Measures, TrailPoint
from posture.play.session import Session
from posture.play.theory_worker import LeastCost

SHORT_S, LONG_S = 10.0, 30.0
"""[s] shown of the joint angles and the centre of pressure, and of the correlation and the cost."""
SAMPLES = 200
"""Largest number of samples of a signal in a chart."""
FONT = "font:12px system-ui,sans-serif;color:#222"
BLACK = "#333333"
ANKLE_RANGE, HIP_RANGE = (-16.0, 8.0), (-30.0, 30.0)
"""[deg]"""
COST_ENDS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0)
"""Upper ends of the axis of costs; 4 is the cost of four joints at their limits."""
MODES = ("in-phase", "anti-phase")
DIRECTION_COLOUR = {1: ORANGE, -1: BLUE, 0: GREY}
DIRECTIONS = {1: "rising", -1: "falling", 0: "constant"}


class Plots:
    """Added to `gui`; `refresh` reads the session."""

    def __init__(self, gui: viser.GuiApi, config: PlayConfig, sole: tuple[float, float]) -> None:
        """`sole`: its ends in the foot frame [m]."""
        self._headline, self._numbers = gui.add_html(""), gui.add_html("")
        ago, long_ago = (-SHORT_S, 0.0), (-LONG_S, 0.0)
        modes = [_points(MODE_COLOUR[mode]) for mode in MODES]
        directions = [_points(DIRECTION_COLOUR[direction]) for direction in DIRECTIONS]
        r_range, freq_range = (-1.05, 1.05), (0.0, config.sliders.freq[1])
        title = "hip (pink) and ankle (green) [deg], last 10 s"
        self.angles = _chart(gui, title, [_line(HIP_COLOUR), _line(ANKLE_COLOUR)], ago)
        title = "hip against ankle [deg], last cycle"
        self.loop = _chart(gui, title, [*modes, _points(GREY), _points(BLACK, 9)], ANKLE_RANGE, HIP_RANGE)
        title = "correlation against frequency [Hz]: rising (orange), falling (blue)"
        self.trail = _chart(gui, title, [*directions, _line(BLACK, dash=(4, 3))], freq_range, r_range)
        self.correlation = _chart(gui, "running correlation, last 30 s", modes, long_ago, r_range)
        self.cost = _chart(
            gui, "cost (black) and least cost (grey)", [_points(GREY), _points(BLACK)], long_ago, (0.0, COST_ENDS[0])
        )
        title = "centre of pressure between heel and toe [mm]"
        self.pressure = _chart(gui, title, [_line(GREY), _line(GREY), _points(ORANGE)], ago, _around(sole))
        self._past: list[tuple[float, float, float, float]] = []  # time, correlation, cost, least cost

    def refresh(self, session: Session) -> None:
        """Show the present state of the session."""
        measures, theory, history = session.measures(), session.theory(), session.history
        self._headline.content = headline(measures, session.fallen, session.paused, session.ramping, session.settings.freq)
        self._numbers.content = numbers(measures, theory, session.message, session.falls, session.foot_drift)
        cycle = math.ceil(1 / (session.settings.freq * session.dt))
        self.loop.data = loop(history.last("ankle", cycle), history.last("hip", cycle), measures.mode)
        self.trail.data = trail(list(session.trail.points), None if theory is None else theory.transition)
        count = round(SHORT_S / session.dt)
        every = max(1, count // SAMPLES)
        signals = {name: history.last(name, count)[::-every][::-1] for name in ("time", "hip", "ankle", "cop")}
        ago = signals["time"] - session.time
        self.angles.data = _data(ago, np.degrees(signals["hip"]), np.degrees(signals["ankle"]))
        heel, toe = (np.full(len(ago), end) for end in session.sole)
        if self.pressure.scales != (foot := _scales((-SHORT_S, 0.0), _around(session.sole))):  # another body
            self.pressure.scales = foot
        self.pressure.data = _data(ago, *(1e3 * values for values in (heel, toe, signals["cop"])))
        if not self._past or session.time > self._past[-1][0]:  # not paused
            least_cost = math.nan if theory is None else theory.at(measures.freq)
            self._past.append((session.time, measures.r, measures.cost, least_cost))
            self._past = [past for past in self._past if past[0] > session.time - LONG_S]
        time, r, cost, least = np.array(self._past).T
        self.correlation.data = _data(time - session.time, np.where(r > 0, r, np.nan), np.where(r < 0, r, np.nan))
        largest = max([value for value in (*cost, *least) if math.isfinite(value)], default=0.0)
        y = 0.0, next((end for end in COST_ENDS if end >= largest), COST_ENDS[-1])
        if self.cost.scales != (scales := _scales((-LONG_S, 0.0), y)):
            self.cost.scales = scales
        self.cost.data = _data(time - session.time, least, cost)


def headline(measures: Measures, fallen: bool, paused: bool, ramping: int, freq: float) -> str:
    """The mode, large and in its colour, and the frequency of the target."""
    mode = "fallen" if fallen else measures.mode
    colour = FALL_COLOUR if fallen else MODE_COLOUR[mode]
    direction = "paused" if paused else DIRECTIONS[ramping]
    r = "correlation not yet defined" if math.isnan(measures.r) else f"hip-ankle correlation {measures.r:+.2f}"
    return (
        f'<div style="{FONT};border-left:8px solid {colour};padding:2px 0 2px 10px;margin:0 0 6px">'
        f'<div style="font-size:26px;font-weight:700;color:{colour};line-height:1.15" data-mode="{mode}">{mode}</div>'
        f"<div>{r}, over {measures.window:.1f} s</div>"
        f"<div>target at <b>{freq:.3f} Hz</b>, {direction}</div></div>"
    )


def numbers(measures: Measures, theory: LeastCost | None, message: str, falls: int, foot_drift: float) -> str:
    """A table: transition frequency of the theory, cost and least cost, tracking error, drift and falls; the message."""
    if theory is None:
        transition = least = ratio = "<i>computing…</i>"
    else:
        transition = "none" if theory.transition is None else f"{theory.transition:.3f} Hz"
        value = theory.at(measures.freq)
        least = f"{value:.4f}" if math.isfinite(value) else "no feasible motion"
        ratio = _number(measures.cost / value, ".2f")
    rows = {
        "transition frequency f* (theory)": transition,
        "cost Σ(τ/limit)²": _number(measures.cost, ".4f"),
        "least cost (theory)": least,
        "cost / least cost": ratio,
        "tracking error (rms)": _number(1e3 * measures.error, ".1f", " mm"),
        "head outside the tolerance": _number(100 * measures.beyond, ".0f", " % of time"),
        "foot drift / falls": f"{1e3 * foot_drift:z.0f} mm / {falls}",
    }
    cells = "".join(f"<tr><td>{name}</td><td align='right'><b>{value}</b></td></tr>" for name, value in rows.items())
    note = f'<div style="color:{FALL_COLOUR}">{escape(message)}</div>' if message else ""
    return f'<table style="{FONT};width:calc(100% - 24px);margin-left:10px">{cells}</table>{note}'


def loop(ankle: Array, hip: Array, mode: str) -> tuple[Array, ...]:
    """Ankle angle [deg], ascending; hip angle [deg] in the column of `mode` (in-phase, anti-phase, undefined); and the
    present hip angle in the last column. It rises to the right in-phase and falls anti-phase."""
    every = max(1, len(ankle) // SAMPLES)
    # The newest first; angles out of range are drawn at the edge.
    x, y = np.clip(np.degrees(ankle[::-every]), *ANKLE_RANGE), np.clip(np.degrees(hip[::-every]), *HIP_RANGE)
    columns = [np.where(mode == name, y, np.nan) for name in (*MODES, "undefined")]
    now = np.where(np.arange(len(x)) == 0, y, np.nan)
    order = np.argsort(x)
    return _data(x[order], *(column[order] for column in (*columns, now)))


def trail(points: list[TrailPoint], transition: float | None) -> tuple[Array, ...]:
    """Frequency [Hz], ascending; correlation by `DIRECTIONS`; and a vertical line at `transition`."""
    ends = [] if transition is None else [(transition, math.nan, math.nan, math.nan, end) for end in (-1.0, 1.0)]
    rows = [(p.freq, *(p.r if p.direction == way else math.nan for way in DIRECTIONS), math.nan) for p in points]
    table = np.array([*rows, *ends]).reshape(-1, 5)
    return _data(*table[np.argsort(table[:, 0], kind="stable")].T)


def _around(sole: tuple[float, float]) -> tuple[float, float]:
    """Range of the chart of the centre of pressure [mm], from the ends of the sole [m]."""
    return 1e3 * sole[0] - 10.0, 1e3 * sole[1] + 10.0


def _data(*columns: Array) -> tuple[Array, ...]:
    """Columns for a chart, which needs two samples or more."""
    return tuple(x.astype(np.float64) if len(x) > 1 else np.full(2, np.nan) for x in columns)


def _line(colour: str, dash: tuple[float, ...] = ()) -> uplot.Series:
    return uplot.Series(label="", stroke=colour, width=2, dash=dash, points=uplot.Series_Points(show=False))


def _points(colour: str, size: float = 4) -> uplot.Series:
    return uplot.Series(
        label="", stroke=colour, width=0, points=uplot.Series_Points(show=True, size=size, fill=colour, width=0)
    )


def _chart(
    gui: viser.GuiApi, title: str, curves: list[uplot.Series], x: tuple[float, float], y: tuple[float, float] | None = None
) -> viser.GuiUplotHandle:
    """An empty chart; ranges of its axes, that of y automatic if None."""
    font = "11px system-ui"
    return gui.add_uplot(
        _data(*(len(curves) + 1) * [np.empty(0)]),
        (uplot.Series(label=""), *curves),
        title=title,
        scales=_scales(x, y),
        axes=(uplot.Axis(size=30, font=font), uplot.Axis(size=42, font=font)),
        legend=uplot.Legend(show=False),
        height=125,
        padding=(6, 14, 0, 0),
    )


def _scales(x: tuple[float, float], y: tuple[float, float] | None) -> dict[str, uplot.Scale]:
    return {"x": uplot.Scale(time=False, range=x), "y": uplot.Scale() if y is None else uplot.Scale(range=y)}


def _number(value: float, form: str, unit: str = "") -> str:
    return f"{value:{form}}{unit}" if math.isfinite(value) else "–"
