"""Shows how a training goes: one live line on a terminal, a plain line now and then elsewhere."""

import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PLAIN_EVERY_S = 10.0
"""Seconds between two plain lines; a log of a long run stays readable."""
WATCH_EVERY_S = 0.5
"""Seconds between two looks at Warp's kernel cache, which grows while it compiles."""


@dataclass(frozen=True)
class Status:
    """What one training iteration reports."""

    iteration: int
    total: int
    steps_per_s: float
    reward: float | None
    episode_length: float | None
    error_mm: float
    cost: float
    learning_rate: float
    seconds_left: float

    def __str__(self) -> str:
        reward, length, left = self._common()
        return (
            f"iteration {self.iteration}/{self.total} | {self.steps_per_s:,.0f} steps/s | reward {reward} | "
            f"episode {length} steps | error {self.error_mm:.1f} mm | cost {self.cost:.3f} | "
            f"lr {self.learning_rate:.1e} | {left} left"
        )

    @property
    def short(self) -> str:
        """The same in fewer than 80 characters."""
        reward, length, left = self._common()
        return (
            f"{self.iteration}/{self.total} {self.steps_per_s / 1e3:.1f}k/s rew {reward} ep {length} "
            f"err {self.error_mm:.1f}mm cost {self.cost:.3f} lr {self.learning_rate:.0e} {left} left"
        )

    def _common(self) -> tuple[str, str, str]:
        """Mean reward and episode length, a dash before the first episode has ended, and the time left as m:ss."""
        minutes, seconds = divmod(round(self.seconds_left), 60)
        reward = "-" if self.reward is None else f"{self.reward:.4g}"
        length = "-" if self.episode_length is None else f"{self.episode_length:.0f}"
        return reward, length, f"{minutes}:{seconds:02d}"


class Progress:
    """Prints `Status` lines to stdout."""

    def __init__(self) -> None:
        self._live = sys.stdout.isatty()
        self._width = 0
        self._last = float("-inf")

    def show(self, status: Status) -> None:
        """Show the newest status; the last iteration is always shown."""
        final = status.iteration >= status.total
        line = str(status)
        if self._live:
            # A line that wraps could not be overwritten.
            room = shutil.get_terminal_size().columns - 1
            line = (line if len(line) <= room else status.short)[:room]
            print("\r" + line.ljust(self._width), end="\n" if final else "", flush=True)
            self._width = len(line)
        elif final or time.monotonic() - self._last >= PLAIN_EVERY_S:
            self._last = time.monotonic()
            print(line, flush=True)


@contextmanager
def preparing() -> Iterator[None]:
    """While the body of this `with` runs, say so once if Warp compiles kernels, which takes up to a minute."""
    import warp

    warp.init()
    cache = Path(warp.config.kernel_cache_dir)
    before = _entries(cache)
    done = threading.Event()

    def watch() -> None:
        while not done.wait(WATCH_EVERY_S):
            if _entries(cache) > before:
                print("compiling kernels, first run only", flush=True)
                return

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


def _entries(folder: Path) -> int:
    return sum(1 for _ in folder.iterdir()) if folder.is_dir() else 0
