"""What the page draws beside the body: numbers and pictures as HTML and SVG; pure functions, measures in, text out."""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape

import numpy as np

from posture.analysis.trajectory import Array
from posture.drawing.style import BLUE, FALL_COLOUR, GREY, MODE_COLOUR, ORANGE
from posture.play.measures import Measures
from posture.play.theory import Least

RISING, FALLING = ORANGE, BLUE
SQUARE, MARGIN = 170, 26  # [px] of a square picture, and of its margin for labels
TOPS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0)
"""Ends of the axis of costs, the last what four joints at their limits cost."""
STYLE = "font:12px system-ui,sans-serif;color:#222"


def headline(measures: Measures, fallen: bool, paused: bool, ramping: int, freq: float) -> str:
    """The mode, large and in its colour, and the frequency it is at."""
    mode = "fallen" if fallen else measures.mode
    colour = FALL_COLOUR if fallen else MODE_COLOUR[mode]
    doing = "paused" if paused else {1: "rising", -1: "falling", 0: "held"}[ramping]
    r = "hip and ankle hardly move together yet" if math.isnan(measures.r) else f"hip-ankle correlation {measures.r:+.2f}"
    return (
        f'<div style="{STYLE};border-left:8px solid {colour};padding:2px 0 2px 10px;margin:0 0 6px">'
        f'<div style="font-size:26px;font-weight:700;color:{colour};line-height:1.15" data-mode="{mode}">{mode}</div>'
        f"<div>{r}, over {measures.window:.1f} s</div>"
        f"<div>target at <b>{freq:.3f} Hz</b>, {doing}</div></div>"
    )


def numbers(measures: Measures, theory: Least | None, note: str, falls: int, crept: float) -> str:
    """Cost against the least cost, where theory has the switch, tracking, and what else is to be said."""
    if theory is None:
        switch = least = ratio = "<i>computing…</i>"
    else:
        switch = "none" if theory.transition is None else f"{theory.transition:.3f} Hz"
        value = theory.at(measures.freq)
        known = math.isfinite(value)
        least = f"{value:.4f}" if known else "no motion keeps foot and tolerance"
        ratio = _number(measures.cost / value, ".2f") if known else "–"
    rows = [
        ("switch in theory, f*", switch),
        ("cost Σ(τ/limit)²", _number(measures.cost, ".4f")),
        ("least cost (theory)", least),
        ("cost / least cost", ratio),
        ("head from target, rms", _number(1e3 * measures.error, ".1f", " mm")),
        ("beyond the tolerance", _number(100 * measures.beyond, ".0f", " % of time")),
        ("feet crept / falls", f"{1e3 * crept:z.0f} mm / {falls}"),
    ]
    cells = "".join(
        f"<tr><td>{name}</td><td style='text-align:right;font-weight:600'>{value}</td></tr>" for name, value in rows
    )
    said = f'<div style="color:{FALL_COLOUR}">{escape(note)}</div>' if note else ""
    return f'<table style="{STYLE};width:calc(100% - 24px);margin-left:10px;border-collapse:collapse">{cells}</table>{said}'


def angle_angle(hip: Array, ankle: Array, mode: str) -> str:
    """Hip over ankle angle [rad], of the last cycle: rising to the right in-phase, falling anti-phase."""
    x, y = np.degrees(ankle), np.degrees(hip)
    box = _Box((-16.0, 8.0), (-40.0, 40.0))
    if len(x):
        # Room for what goes beyond, in steps, so that the scale does not breathe.
        box = _Box(_room(x, -12.0, 6.0, 6.0), _room(y, -20.0, 20.0, 20.0))
    drawn = box.line(x, y, MODE_COLOUR[mode], 1.6)
    if len(x):
        drawn += box.dot(x[-1], y[-1], MODE_COLOUR[mode])
    return box.svg("ankle [deg]", "hip [deg]", drawn, "hip over ankle angle")


def hysteresis(points: Iterable[tuple[float, float, int]], transition: float | None, freqs: tuple[float, float]) -> str:
    """Correlation over frequency [Hz] where it has been, rising and falling apart; a dashed line at f* of the theory."""
    box = _Box((0.0, freqs[1]), (-1.0, 1.0))
    drawn = ""
    if transition is not None:
        x = box.x(transition)
        drawn += f'<path d="M{x:.1f} {box.y(1):.1f}V{box.y(-1):.1f}" stroke="#333" stroke-dasharray="4 3"/>'
        drawn += f'<text x="{x + 3:.1f}" y="{box.y(-1) - 4:.1f}">f*</text>'
    colours = {1: RISING, -1: FALLING, 0: GREY}
    drawn += "".join(
        f'<circle cx="{box.x(f):.1f}" cy="{box.y(r):.1f}" r="1.8" fill="{colours[way]}"/>' for f, r, way in points
    )
    top = box.y(1) - 6
    drawn += f'<text x="{SQUARE - 84}" y="{top:.0f}" fill="{RISING}" font-weight="700">rising</text>'
    drawn += f'<text x="{SQUARE - 42}" y="{top:.0f}" fill="{FALLING}" font-weight="700">falling</text>'
    return box.svg("frequency [Hz]", "r", drawn, "correlation over frequency")


def foot(cop: Array, sole: tuple[float, float]) -> str:
    """The centre of pressure within the foot: where it is, and how far it went of late. All [m], toes to the right."""
    width, height = 2 * SQUARE, 58
    heel, toe = sole
    margin = 0.03
    scale = width / (toe - heel + 2 * margin)

    def x(place: float) -> float:
        return (place - heel + margin) * scale

    drawn = (
        f'<rect x="{x(heel):.1f}" y="12" width="{(toe - heel) * scale:.1f}" height="22" rx="11" fill="#eee" stroke="#888"/>'
        f'<text x="{x(heel):.1f}" y="50">heel {1e3 * heel:.0f}</text>'
        f'<text x="{x(toe):.1f}" y="50" text-anchor="end">toe {1e3 * toe:.0f} mm</text>'
        f'<text x="{x(0):.1f}" y="50" text-anchor="middle">ankle</text><path d="M{x(0):.1f} 34v5" stroke="#888"/>'
    )
    seen = cop[np.isfinite(cop)]
    if len(seen):
        low, high, now = float(seen.min()), float(seen.max()), float(seen[-1])
        drawn += (
            f'<rect x="{x(low):.1f}" y="19" width="{(high - low) * scale:.1f}" height="8" fill="{ORANGE}" opacity=".6"/>'
        )
        drawn += f'<circle cx="{x(now):.1f}" cy="23" r="6" fill="{FALL_COLOUR}"/>'
        drawn += f'<text x="{width / 2}" y="8" text-anchor="middle">centre of pressure {1e3 * now:+.0f} mm</text>'
    return _svg(width, height, drawn, "centre of pressure within the foot")


def strip(title: str, ago: Array, curves: list[tuple[Array, str]], span: float, up: tuple[float, float] | None) -> str:
    """Curves (values, colour) over the last `span` [s]; `ago` [s], negative. A nan is a gap. up: its ends; None: from 0."""
    width, height, left, top, bottom = 2 * SQUARE, 104, 34, 18, 86
    if up is None:
        known = np.concatenate([values[np.isfinite(values)] for values, _ in curves])
        largest = float(known.max()) if len(known) else 0.0
        up = (0.0, next((end for end in TOPS if end >= largest), TOPS[-1]))
    low, high = up
    x = left + (width - left - 8) * (1 + np.clip(ago, -span, 0) / span)
    drawn = (
        f'<path d="M{left} {top}V{bottom}H{width - 8}" fill="none" stroke="#999"/>'
        f'<text x="{width / 2}" y="11" text-anchor="middle">{title}</text>'
        f'<text x="{left - 3}" y="{bottom}" text-anchor="end">{low:g}</text>'
        f'<text x="{left - 3}" y="{top + 8}" text-anchor="end">{high:g}</text>'
        f'<text x="{left}" y="{bottom + 13}">-{span:g} s</text>'
        f'<text x="{width - 8}" y="{bottom + 13}" text-anchor="end">now</text>'
    )
    if low < 0 < high:
        middle = bottom + (bottom - top) * low / (high - low)
        drawn += f'<path d="M{left} {middle:.1f}H{width - 8}" stroke="#ddd"/>'
    for values, colour in curves:
        y = bottom - (bottom - top) * (np.clip(values, low, high) - low) / (high - low)
        path, pen = "", "M"
        for a, b in zip(x, y, strict=True):
            path, pen = (path + f"{pen}{a:.1f} {b:.1f}", "L") if math.isfinite(b) else (path, "M")
        drawn += f'<path d="{path or "M0 0"}" fill="none" stroke="{colour}" stroke-width="2"/>'
    return _svg(width, height, drawn, title)


def row(*pictures: str) -> str:
    """Pictures side by side."""
    return f'<div style="{STYLE};display:flex;flex-wrap:wrap;gap:4px;justify-content:center">{"".join(pictures)}</div>'


class _Box:
    """A square picture with an axis below and one to the left."""

    def __init__(self, across: tuple[float, float], up: tuple[float, float]) -> None:
        self._across, self._up = across, up

    def x(self, value: float) -> float:
        low, high = self._across
        return MARGIN + (SQUARE - MARGIN - 6) * (min(max(value, low), high) - low) / (high - low)

    def y(self, value: float) -> float:
        low, high = self._up
        return SQUARE - MARGIN - (SQUARE - MARGIN - 18) * (min(max(value, low), high) - low) / (high - low)

    def line(self, x: Array, y: Array, colour: str, width: float) -> str:
        every = max(1, len(x) // 200)
        points = " ".join(f"{self.x(a):.1f},{self.y(b):.1f}" for a, b in zip(x[::-every], y[::-every], strict=True))
        return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width}"/>'

    def dot(self, x: float, y: float, colour: str) -> str:
        return f'<circle cx="{self.x(x):.1f}" cy="{self.y(y):.1f}" r="4" fill="{colour}"/>'

    def svg(self, across: str, up: str, drawn: str, title: str) -> str:
        left, right, bottom, top = self.x(self._across[0]), self.x(self._across[1]), self.y(self._up[0]), self.y(self._up[1])
        frame = f'<path d="M{left} {top}V{bottom}H{right}" fill="none" stroke="#999"/>'
        if self._across[0] < 0 < self._across[1]:
            frame += f'<path d="M{self.x(0):.1f} {top}V{bottom}" stroke="#ddd"/>'
        if self._up[0] < 0 < self._up[1]:
            frame += f'<path d="M{left} {self.y(0):.1f}H{right}" stroke="#ddd"/>'
            frame += f'<text x="{left - 3}" y="{self.y(0) + 4:.1f}" text-anchor="end">0</text>'
        frame += (
            f'<text x="{left}" y="{bottom + 12}" text-anchor="middle">{self._across[0]:g}</text>'
            f'<text x="{right}" y="{bottom + 12}" text-anchor="end">{self._across[1]:g}</text>'
            f'<text x="{(left + right) / 2}" y="{bottom + 23}" text-anchor="middle">{across}</text>'
            f'<text x="{left - 3}" y="{bottom}" text-anchor="end">{self._up[0]:g}</text>'
            f'<text x="{left - 3}" y="{top + 8}" text-anchor="end">{self._up[1]:g}</text>'
            f'<text x="2" y="10">{up}</text>'
        )
        return _svg(SQUARE, SQUARE, frame + drawn, title)


def _svg(width: int, height: int, drawn: str, title: str) -> str:
    return (
        f'<svg width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-size="11" fill="#444" role="img" '
        f'aria-label="{title}">{drawn}</svg>'
    )


def _room(values: Array, low: float, high: float, step: float) -> tuple[float, float]:
    """low .. high, widened by whole steps until `values` fit."""
    below = max(0, math.ceil((low - values.min()) / step))
    above = max(0, math.ceil((values.max() - high) / step))
    return low - step * below, high + step * above


def _number(value: float, form: str, unit: str = "") -> str:
    return f"{value:{form}}{unit}" if math.isfinite(value) else "–"
