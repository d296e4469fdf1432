"""The pictures of the films. Static artists are drawn once; each frame draws the moving ones over them."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from envs.config import Person
from posture.analysis.coordination import mode
from posture.analysis.ramp import ramp_transition
from posture.analysis.trajectory import Array
from posture.drawing.silhouette import draw_phases
from posture.drawing.style import ANKLE_COLOUR, BLUE, FALL_COLOUR, GREY, HIP_COLOUR, MODE_COLOUR, RED, styled
from posture.drawing.view import StanderView
from posture.film.sampling import SampledTrial
from posture.film.video import Frame

PANEL_IN = 3.6  # width of a panel, which text sizes refer to [in]
HEIGHT_TWO_MODES, HEIGHT_RAMP = 4.5, 6.0  # of the films at that width [in]
LARGE, MEDIUM, SMALL = 16, 13, 11  # text sizes [pt]
PHASES = np.linspace(0.0, 1.0, 5)  # of a cycle, at which bodies are drawn side by side
SPACING = 0.52  # between these bodies [m]
MARK_HEIGHT = -0.1  # of the mark under these bodies [m]
CURSOR = {"color": "black", "lw": 1.0, "alpha": 0.6}


class Film(Sequence[Frame]):
    """A sequence of frames, drawn on access. `moving` artists are drawn in each frame, in this order; all others once."""

    def __init__(self, width: int, panels: int, height_in: float, time: Array) -> None:
        """`width` [px] of a panel; `height_in` of the film where a panel is PANEL_IN wide; frames at `time` (F,) [s]."""
        dpi = width / PANEL_IN
        height = 2 * round(height_in * dpi / 2)  # even, which H.264 requires
        # 0.01 px more: the canvas truncates sizes to whole pixels.
        with styled():
            self.figure = Figure(figsize=((width * panels + 0.01) / dpi, (height + 0.01) / dpi), dpi=dpi)
        self.canvas = FigureCanvasAgg(self.figure)
        self.time = time
        self.moving: list[Artist] = []
        self._background: Any = None

    @property
    def fps(self) -> float:
        """Frames per second."""
        return 1 / float(self.time[1] - self.time[0])

    @abstractmethod
    def show(self, i: int) -> None:
        """Move the moving artists to frame `i`."""

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, i: Any) -> Any:
        if not 0 <= i < len(self):
            raise IndexError(i)
        with styled():
            if self._background is None:
                for artist in self.moving:
                    artist.set_animated(True)
                self.canvas.draw()
                self._background = self.canvas.copy_from_bbox(self.figure.bbox)
            self.canvas.restore_region(self._background)
            self.show(i)
            for artist in self.moving:
                self.figure.draw_artist(artist)
        return np.array(self.canvas.buffer_rgba())[..., :3].copy()


class TwoModesFilm(Film):
    """Standers at different frequencies side by side: each moving, beside five moments of a cycle (paper Fig. 2) and its
    hip and ankle angles over that cycle."""

    def __init__(
        self,
        motions: Sequence[SampledTrial],
        cycles: Sequence[SampledTrial],
        width: int,
        reach: float,
        person: Person | None = None,
    ) -> None:
        """`motions` at the frames of the film; `cycles` of the same standers at evenly spaced moments of a cycle, both ends
        included. `width` [px] of a panel; the targets move between 0 and `reach` [m]. `person`: whose body it is; None: the
        paper's."""
        super().__init__(width, len(motions), HEIGHT_TWO_MODES, motions[0].time)
        self.panels: list[tuple[SampledTrial, StanderView, Text, Line2D, list[Line2D]]] = []
        with styled():
            for number, (motion, cycle) in enumerate(zip(motions, cycles, strict=True)):
                self._add(number / len(motions), 1 / len(motions), motion, cycle, reach, person)

    def _add(
        self, left: float, share: float, motion: SampledTrial, cycle: SampledTrial, reach: float, person: Person | None
    ) -> None:
        """Add a panel that starts at `left` and is `share` wide, as shares of the figure."""
        fig, freq = self.figure, float(motion.freq[0])

        def axes(x: float, y: float, wide: float, high: float) -> Axes:
            return fig.add_axes((left + share * x, y, share * wide, high))

        if left:
            fig.add_artist(Line2D([left, left], [0.04, 0.96], color=GREY, lw=0.8, alpha=0.5))
        fig.text(left + 0.05 * share, 0.925, f"{freq:g} Hz", fontsize=LARGE, fontweight="bold")
        title = fig.text(left + 0.05 * share, 0.855, "", fontsize=LARGE, fontweight="bold")
        view = StanderView(axes(0.01, 0.01, 0.38, 0.82), reach, person)
        bodies, angles = axes(0.39, 0.42, 0.60, 0.41), axes(0.54, 0.12, 0.37, 0.24)
        at = np.round(PHASES * (len(cycle.time) - 1)).astype(int)
        places = draw_phases(
            bodies, cycle.hip[at], cycle.ankle[at], cycle.target_x[at], SPACING,
            foot_x=cycle.foot_x[at], person=person,
        )  # fmt: skip
        _plot_angles(angles, np.linspace(places[0], places[-1], len(cycle.time)), cycle)
        angles.set(xticks=places[[0, 2, 4]], xlim=places[[0, -1]])
        angles.set_xticklabels(["0", f"{0.5 / freq:.3g}", f"{1 / freq:.3g} s"])
        # The present phase of the moving body.
        (mark,) = bodies.plot([0], [MARK_HEIGHT], "^", ms=9, color="black", clip_on=False, zorder=4)
        (line,) = angles.plot([0, 0], [0, 1], transform=angles.get_xaxis_transform(), **CURSOR)
        dots = [angles.plot([0], [0], "o", ms=8, mfc=c, mec="white", clip_on=False)[0] for c in (HIP_COLOUR, ANKLE_COLOUR)]
        self.panels.append((motion, view, title, line, [mark, *dots]))
        self._length = float(places[-1])
        self.moving += [*view.moving, title, line, mark, *dots]

    def show(self, i: int) -> None:
        for motion, view, title, line, (mark, hip, ankle) in self.panels:
            view.show(*motion.pose(i))
            _show_mode(title, motion, i)
            place = self._length * (float(motion.time[i] * motion.freq[i]) % 1.0)
            line.set_xdata([place, place])
            mark.set_xdata([place])
            hip.set_data([place], [math.degrees(motion.hip[i])])
            ankle.set_data([place], [math.degrees(motion.ankle[i])])


class RampFilm(Film):
    """A stander whose target gets faster (paper Exp. 4a), beside its angles in the window of the correlation, and above the
    running correlation against the momentary frequency."""

    def __init__(
        self, motion: SampledTrial, trailing: Array, trace: SampledTrial, window: float, width: int, reach: float,
        paper_hz: float, person: Person | None = None,
    ) -> None:  # fmt: skip
        """`motion` at the frames, with the centred correlation; `trailing` correlation at the frames, (F,); `trace`, like
        `motion` but at the control steps; `window` of the correlation [s]; `paper_hz`: frequency at which the paper's
        correlation changes sign [Hz]. See `TwoModesFilm`."""
        super().__init__(width, 2, HEIGHT_RAMP, motion.time)
        self._motion, self._trailing, self._trace, self._half = motion, trailing, trace, window / 2
        with styled():
            fig = self.figure
            self.view = StanderView(fig.add_axes((0.02, 0.37, 0.26, 0.61)), reach, person)
            self._freq = fig.text(0.34, 0.92, "", fontsize=LARGE, fontweight="bold")
            self._clock = fig.text(0.02, 0.93, "", fontsize=MEDIUM)
            self._mode = fig.text(0.97, 0.92, "", fontsize=LARGE, fontweight="bold", ha="right")
            self._angles = fig.add_axes((0.42, 0.50, 0.55, 0.36))
            self._hip, self._ankle = _plot_angles(self._angles, trace.time, trace)
            self._angles.set(xlim=(-self._half, self._half), xlabel="")
            self._angles.set_xlabel("time from now [s]", fontsize=SMALL)
            self._angles.axvline(0, **CURSOR)
            self._correlation(fig.add_axes((0.11, 0.10, 0.86, 0.28)), paper_hz)
        moving = [self._freq, self._clock, self._mode, self._hip, self._ankle, *self._switch, *self._lines, self._dot]
        self.moving += [*self.view.moving, *moving]

    def _correlation(self, ax: Axes, paper_hz: float) -> None:
        motion, side = self._motion, {"fontsize": MEDIUM, "fontweight": "bold", "transform": ax.transAxes}
        ax.axhspan(0, 1.1, color=BLUE, alpha=0.08, lw=0)
        ax.axhspan(-1.1, 0, color=RED, alpha=0.08, lw=0)
        ax.axhline(0, color="black", lw=0.8)
        ax.text(0.012, 0.88, "in-phase", color=BLUE, va="center", **side)
        ax.text(0.012, 0.12, "anti-phase", color=RED, va="center", **side)
        ax.axvline(paper_hz, color="black", lw=1.2, ls=(0, (4, 3)), alpha=0.7)
        ax.text(paper_hz - 0.008, -0.95, f"paper {paper_hz:g} Hz", fontsize=SMALL, ha="right", va="bottom")
        low, high = float(motion.freq.min()), float(motion.freq.max())
        ax.set(ylim=(-1.1, 1.1), yticks=(-1, 0, 1), xlim=(low, high + 1e-9))
        ax.tick_params(labelsize=SMALL)
        ax.set_xlabel("momentary frequency of the target [Hz]", fontsize=SMALL)
        ax.set_ylabel("correlation", fontsize=SMALL)
        found = ramp_transition(motion.freq, motion.r).freq_hz
        self._switch_hz = math.inf if found is None else found
        at = min(self._switch_hz, high)
        self._switch = [
            ax.plot([at, at], [-1.1, 1.1], color="black", lw=1.5)[0],
            ax.text(at + 0.012, 1.0, f"{at:.2f} Hz", fontsize=MEDIUM, fontweight="bold", va="top"),
        ]
        self._lines = [ax.plot([], [], color=c, lw=w)[0] for c, w in ((GREY, 1.3), (BLUE, 3.0), (RED, 3.0))]
        names = [f"{2 * self._half:.0f} s around now", f"last {2 * self._half:.0f} s"]
        ax.legend(self._lines[1::-1], names, title="window", loc="lower left", bbox_to_anchor=(0.28, 0.0), fontsize=SMALL,
                  title_fontsize=SMALL, alignment="left", handlelength=1.5, labelspacing=0.2)  # fmt: skip
        (self._dot,) = ax.plot([], [], "o", ms=9, mec="white", color="black", clip_on=False)

    def show(self, i: int) -> None:
        motion, now = self._motion, float(self._motion.time[i])
        self.view.show(*motion.pose(i))
        self._freq.set_text(f"{motion.freq[i]:.2f} Hz")
        self._clock.set_text(f"{now:.1f} s")
        _show_mode(self._mode, motion, i)
        near = slice(*np.searchsorted(self._trace.time, [now - self._half, now + self._half]))
        for line, signal in ((self._hip, self._trace.hip), (self._ankle, self._trace.ankle)):
            line.set_data(self._trace.time[near] - now, np.degrees(signal[near]))
        freq, r = motion.freq[: i + 1], motion.r[: i + 1]
        for line, shown in zip(self._lines, (self._trailing[: i + 1], _where(r, r >= 0), _where(r, r <= 0)), strict=True):
            line.set_data(freq, shown)
        for artist in self._switch:
            artist.set_visible(bool(motion.freq[i] >= self._switch_hz))
        self._dot.set_data([motion.freq[i]], [motion.r[i]])


def _where(values: Array, wanted: Any) -> Array:
    """`values` where they are `wanted`, else nan."""
    return np.where(wanted, values, np.nan)


def _plot_angles(ax: Axes, x: Array, motion: SampledTrial) -> list[Line2D]:
    """Plot hip and ankle angle [deg] against `x`, with their names above; the y axis fits the whole motion."""
    lines = []
    for signal, colour, name in ((motion.hip, HIP_COLOUR, "hip"), (motion.ankle, ANKLE_COLOUR, "ankle")):
        lines += ax.plot(x, np.degrees(signal), color=colour, lw=2.4)
        place = {"hip": (0.02, "left"), "ankle": (0.98, "right")}[name]
        ax.text(place[0], 1.02, name, color=colour, fontsize=MEDIUM, fontweight="bold", ha=place[1], va="bottom",
                transform=ax.transAxes)  # fmt: skip
    both = np.degrees(np.concatenate([motion.hip, motion.ankle]))
    margin = 0.1 * float(np.ptp(both)) + 0.5
    ax.set_ylim(both.min() - margin, both.max() + margin)
    ax.locator_params(axis="y", nbins=4)
    ax.tick_params(labelsize=SMALL)
    ax.set_ylabel("angle [deg]", fontsize=SMALL)
    return lines


def _show_mode(text: Text, motion: SampledTrial, i: int) -> None:
    """Set `text` to the mode of the running correlation, in its colour, or to the fall."""
    if motion.time[i] >= motion.fall:
        text.set(text="fell", color=FALL_COLOUR)
        return
    r = float(motion.r[i])
    name = mode(r)
    number = f"   r = {r:+.2f}".replace("-", "\u2212") if math.isfinite(r) else ""
    text.set(text=name + number, color=MODE_COLOUR[name])
