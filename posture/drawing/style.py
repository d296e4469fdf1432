"""Colours and matplotlib settings of every figure and film."""

from contextlib import AbstractContextManager
from typing import Any

import matplotlib.style

# Okabe and Ito's palette, distinguishable by colour-blind readers.
BLUE, ORANGE, GREEN, RED, PURPLE, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#7F7F7F"
HIP_COLOUR, ANKLE_COLOUR, HEAD_COLOUR, FALL_COLOUR = PURPLE, GREEN, "black", "#A00000"
MODE_COLOUR = {"in-phase": BLUE, "anti-phase": RED, "undefined": GREY}
STYLE = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "figure.dpi": 150,
    "savefig.dpi": 150,
}


def styled(**changes: Any) -> AbstractContextManager[None]:
    """A context in which figures are drawn in STYLE with `changes`, whatever a user's matplotlibrc says."""
    return matplotlib.style.context({**STYLE, **changes}, after_reset=True)
