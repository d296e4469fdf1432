"""What the films look like: figures whose moving parts are updated frame by frame, on matplotlib's Agg canvas.

A scene draws what stands still once. `show(frame)` brings the moving artists to a frame, `frames()` gives all as pixels.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from posture.coordination import mode
from posture.figures import ANKLE_COLOUR, FALL_COLOUR, GREY, HIP_COLOUR, MODE_COLOUR
from posture.film_take import Take
from posture.film_writer import Frame
from posture.report.silhouette import draw_body, draw_ground, draw_target, head_position, move_body
from posture.trajectory import Array

HEIGHT_IN = 4.8  # of the figure [inch]; with its pixels this fixes the resolution, and so the size of the letters
PANEL = 0.625  # width of a panel over the height of the film
BEHIND, AHEAD = -0.45, 0.65  # of the ground [m]
FONT, SMALL = 15, 11  # [points]


class Scene:
    """A figure of `width` x `height` pixels, with moving artists."""

    def __init__(self, width: int, height: int, count: int) -> None:
        self.count = count
        self.figure = Figure(figsize=(HEIGHT_IN * width / height, HEIGHT_IN), dpi=height / HEIGHT_IN, facecolor="white")
        self.canvas = FigureCanvasAgg(self.figure)
        self.moving: list[Artist] = []

    def show(self, frame: int) -> None:
        """Bring the moving artists to a frame, 0 .. count - 1."""
        raise NotImplementedError

    def frames(self) -> Iterator[Frame]:
        """Every frame as pixels, (height, width, 3). What stands still is drawn once."""
        self.show(0)
        for artist in self.moving:
            artist.set_animated(True)
        self.canvas.draw()
        still = self.canvas.copy_from_bbox(self.figure.bbox)
        for frame in range(self.count):
            self.show(frame)
            self.canvas.restore_region(still)
            for artist in sorted(self.moving, key=lambda artist: artist.get_zorder()):
                self.figure.draw_artist(artist)
            yield np.asarray(self.canvas.buffer_rgba())[..., :3].copy()


class Stage:
    """The body from the side with its target, in one pair of axes, and the words above it."""

    def __init__(self, ax: Axes, take: Take, target_height: float, amplitude: float) -> None:
        self.take, self.target_height = take, target_height
        ax.set_axis_off()
        self.body = draw_body(ax, 0.0, 0.0)
        draw_ground(ax, BEHIND, AHEAD)
        ax.plot([0, 2 * amplitude], 2 * [target_height], "|-", color=GREY, lw=1, ms=9, zorder=1)
        before = list(ax.lines), list(ax.patches)
        draw_target(ax, 0.0, target_height)
        (self.thread,) = [line for line in ax.lines if line not in before[0]]
        (self.target,) = [patch for patch in ax.patches if patch not in before[1]]
        self.head = Line2D([0], [0], marker="o", color="black", ms=5, ls="none", zorder=4)
        ax.add_line(self.head)
        ax.set(xlim=(BEHIND, AHEAD), ylim=(-0.05, target_height + 0.06))
        self.clock = ax.figure.text(0, 0, "", fontsize=SMALL, ha="center", va="top")
        self.verdict = ax.figure.text(0, 0, "", fontsize=FONT, fontweight="bold", ha="center", va="top")
        self.picture: list[Artist] = [*self.body, self.thread, self.target, self.head]
        self.moving: list[Artist] = [*self.picture, self.clock, self.verdict]

    def show(self, frame: int) -> None:
        """Move everything to a frame of the take; the body stays where it fell."""
        take = self.take
        self.target.set_center((take.target_x[frame], self.target_height))
        stands = bool(np.isfinite(take.head_x[frame]))
        if stands:
            hip, ankle, foot = float(take.hip[frame]), float(take.ankle[frame]), take.foot_x(frame)
            move_body(self.body, hip, ankle, foot_x=foot)
            x, z = head_position(hip, ankle, foot)
            self.head.set_data([x], [z])
            self.thread.set_data(2 * [take.target_x[frame]], [z, self.target_height])
        self.verdict.set_text(verdict(float(take.r[frame])) if stands else "fallen")
        self.verdict.set_color(MODE_COLOUR[mode(float(take.r[frame]))] if stands else FALL_COLOUR)


class SideBySide(Scene):
    """Steady motion at several frequencies, a panel each; below, the joint angles over one cycle of its target."""

    def __init__(self, takes: Sequence[Take], target_height: float, amplitude: float, height: int) -> None:
        panel = 2 * round(PANEL * height / 2)
        super().__init__(len(takes) * panel, height, len(takes[0].time))
        self.stages: list[Stage] = []
        self.dots: list[tuple[Line2D, Line2D]] = []
        share = 1 / len(takes)
        span = 1.15 * max(float(np.nanmax(np.abs(_swing(angle)))) for take in takes for angle in (take.hip, take.ankle))
        for i, take in enumerate(takes):
            stage = Stage(self.figure.add_axes((i * share, 0.29, share, 0.555)), take, target_height, amplitude)
            centre = (i + 0.5) * share
            self.figure.text(centre, 0.985, f"target {take.freq[0]:g} Hz", fontsize=FONT, ha="center", va="top")
            stage.verdict.set_position((centre, 0.925))
            stage.clock.set(position=(centre + 0.46 * share, 0.80), ha="right")
            self.stages.append(stage)
            ax = self.figure.add_axes(((i + 0.16) * share, 0.105, 0.79 * share, 0.165))
            self.dots.append(self._cycle(ax, take, span, i == 0))
            self.moving += [*stage.moving, *self.dots[-1]]

    def show(self, frame: int) -> None:
        for stage, dots in zip(self.stages, self.dots, strict=True):
            take = stage.take
            since = float(take.time[frame] - take.time[0])
            stage.show(frame)
            stage.clock.set_text(f"{since:.1f} s")
            for dot, angle in zip(dots, (take.hip, take.ankle), strict=True):
                dot.set_data([since % (1 / take.freq[0])], [_swing(angle)[frame]])

    def _cycle(self, ax: Axes, take: Take, span: float, first: bool) -> tuple[Line2D, Line2D]:
        period = 1 / float(take.freq[0])
        phase = (take.time - take.time[0]) % period
        order = np.argsort(phase)
        for name, angle, colour, style in _joints(take):
            ax.plot(phase[order], _swing(angle)[order], color=colour, ls=style, lw=2, label=name)
        ax.axhline(0, color=GREY, lw=0.6)
        ax.set(xlim=(0, period), ylim=(-span, span), xticks=[0, period / 2, period])
        ax.set_xticklabels(["0", f"{period / 2:.2g}", f"{period:.2g} s"], fontsize=SMALL)
        ax.get_xticklabels()[-1].set_ha("right")
        _plain(ax)
        if first:
            for (name, _, colour, _), x in zip(_joints(take), (0.02, 0.2), strict=True):
                ax.text(x, 1.0, name, color=colour, fontsize=SMALL, fontweight="bold", transform=ax.transAxes, va="bottom")
        hip, ankle = (ax.plot([0], [0], "o", color=c, mec="black", ms=8)[0] for c in (HIP_COLOUR, ANKLE_COLOUR))
        return hip, ankle


class Rise(Scene):
    """The target's frequency rises: the body, and below it the running correlation of hip and ankle so far."""

    def __init__(self, take: Take, target_height: float, amplitude: float, height: int, window: float) -> None:
        super().__init__(4 * round(PANEL * height / 2), height, len(take.time))
        self.take = take
        self.stage = Stage(self.figure.add_axes((0.0, 0.35, 0.52, 0.63)), take, target_height, amplitude)
        self.frequency = self.figure.text(0.75, 0.86, "", fontsize=2 * SMALL, ha="center", va="top")
        self.stage.verdict.set_position((0.75, 0.74))
        self.stage.clock.set(position=(0.75, 0.65), fontsize=FONT)
        ax = self.figure.add_axes((0.10, 0.13, 0.86, 0.17))
        ax.axhline(0, color=GREY, lw=0.8)
        ax.set(xlim=(take.time[0], take.time[-1]), ylim=(-1.08, 1.08), yticks=[-1, 0, 1])
        title = f"hip-ankle correlation in a window of {window:.0f} s"
        ax.set_title(title, fontsize=SMALL, loc="left", pad=3)
        ax.set_xlabel("time [s]", fontsize=SMALL, labelpad=0)
        _plain(ax)
        self.line = LineCollection([], lw=3, zorder=2)
        ax.add_collection(self.line)
        self.cursor = ax.axvline(take.time[0], color="black", lw=1, zorder=3)
        self.moving = [*self.stage.moving, self.frequency, self.line, self.cursor]

    def show(self, frame: int) -> None:
        take = self.take
        self.stage.show(frame)
        self.stage.clock.set_text(f"{take.time[frame]:.1f} s")
        self.frequency.set_text(f"target {take.freq[frame]:.2f} Hz")
        points = np.stack([take.time, take.r], axis=1)[: frame + 1]
        pieces = np.stack([points[:-1], points[1:]], axis=1)
        self.line.set_segments(list(pieces))
        self.line.set_color([MODE_COLOUR[mode(float(r))] for r in points[1:, 1]])
        self.cursor.set_xdata(2 * [take.time[frame]])


def _joints(take: Take) -> tuple[tuple[str, Array, str, str], ...]:
    return ("hip", take.hip, HIP_COLOUR, "-"), ("ankle [deg]", take.ankle, ANKLE_COLOUR, "--")


def _swing(angle: Array) -> Array:
    """An angle about its mean [deg]."""
    return np.degrees(angle - np.nanmean(angle))


def verdict(r: float) -> str:
    """The mode in words, with the correlation; empty where that is nan."""
    return (
        ""
        if math.isnan(r)
        else f"{mode(r)} (r = {r:.2f})".replace("-0.", "\N{MINUS SIGN}0.").replace("-1.", "\N{MINUS SIGN}1.")
    )


def _plain(ax: Axes) -> None:
    ax.tick_params(labelsize=SMALL, length=3)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
