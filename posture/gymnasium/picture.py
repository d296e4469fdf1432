"""One frame: the stander from the side, with its target."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from envs.config import Person
from posture.drawing.style import styled
from posture.drawing.view import StanderView

Frame = NDArray[np.uint8]

WIDTH, HEIGHT = 288, 720
"""Size of a frame [px]; both are multiples of 16, which video codecs prefer."""
DPI = 100
RENDER_MODES = ["rgb_array"]


class Picture:
    """Draws one pose after the other."""

    def __init__(self, reach: float, person: Person | None) -> None:
        """The target moves between 0 and `reach` [m]. `person`: whose body it is; None: the paper's."""
        with styled():
            # 0.01 px more: the canvas truncates sizes to whole pixels.
            figure = Figure(figsize=((WIDTH + 0.01) / DPI, (HEIGHT + 0.01) / DPI), dpi=DPI)
            self._canvas = FigureCanvasAgg(figure)
            self._view = StanderView(figure.add_axes((0, 0, 1, 1)), reach, person)

    def draw(self, hip: float, ankle: float, foot_x: float, head_x: float, target_x: float) -> Frame:
        """The pose of these joint angles [rad] and places [m], as in `StanderView.show`. (height, width, 3)."""
        with styled():
            self._view.show(hip, ankle, foot_x, head_x, target_x)
            self._canvas.draw()
        return np.array(self._canvas.buffer_rgba())[..., :3].copy()


def check_render_mode(mode: str | None) -> str | None:
    """`mode`. Raises ValueError unless it is one of `RENDER_MODES` or None."""
    if mode is not None and mode not in RENDER_MODES:
        raise ValueError(f"render_mode = {mode}: allowed is {', '.join(RENDER_MODES)} or None")
    return mode
