"""The phases of a cycle side by side (paper Fig. 2): a row a frequency; each body moves for a quarter and stays there."""

from collections.abc import Sequence

from posture.coordination import mode
from posture.figures import MODE_COLOUR
from posture.film_scene import FONT, PANEL, SMALL, Scene, Stage, verdict
from posture.film_take import Take

QUARTERS = 4


class Phases(Scene):
    """One cycle of each take, however long it lasts, over `moving` frames; then the last picture for `hold` frames.

    Every take has moving + 1 frames, from the start of a cycle to its end.
    """

    def __init__(
        self, takes: Sequence[Take], target_height: float, amplitude: float, height: int, moving: int, hold: int
    ) -> None:
        super().__init__(4 * round(PANEL * height / 2), height, moving + 1 + hold)
        self.cycle = moving
        self.rows: list[list[Stage]] = []
        share = 1 / len(takes)
        for row, take in enumerate(takes):
            bottom = 1 - (row + 1) * share
            r = float(take.r[0])
            title = f"target {take.freq[0]:g} Hz: {verdict(r)}"
            self.figure.text(
                0.5, bottom + share - 0.01, title, fontsize=FONT - 1, color=MODE_COLOUR[mode(r)], fontweight="bold",
                ha="center", va="top",
            )  # fmt: skip
            stages = []
            for k in range(QUARTERS + 1):
                width = 1 / (QUARTERS + 1)
                ax = self.figure.add_axes((k * width, bottom + 0.05, width, share - 0.12))
                stages.append(Stage(ax, take, target_height, amplitude))
                seconds = k / QUARTERS / float(take.freq[0])
                self.figure.text(
                    (k + 0.5) * width, bottom + 0.045, f"{seconds:.2f} s", fontsize=SMALL, ha="center", va="top"
                )
                self.moving += stages[-1].picture
            self.rows.append(stages)

    def show(self, frame: int) -> None:
        for stages in self.rows:
            for k, stage in enumerate(stages):
                stage.show(min(frame, k * self.cycle // QUARTERS))
                for artist in stage.picture:
                    artist.set_visible(frame >= max(0, k - 1) * self.cycle // QUARTERS)
