"""Shows how a training goes: one live line on a terminal, and a plain line every ten seconds elsewhere."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.text import Text

PLAIN_EVERY_S = 10.0
"""Time between two plain lines [s]."""
CACHE_POLL_S = 0.5
"""Time between two looks at Warp's kernel cache, which grows while Warp compiles [s]."""


@dataclass(frozen=True)
class Status:
    """State of the training after one iteration; no reward and episode length before the first episode has ended."""

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
        """One line; its first 79 characters hold all but episode length and learning rate."""
        minutes, seconds = divmod(round(self.seconds_left), 60)
        reward = "-" if self.reward is None else f"{self.reward:.4g}"
        length = "-" if self.episode_length is None else f"{self.episode_length:.0f} steps"
        return (
            f"{self.iteration}/{self.total}, {minutes}:{seconds:02d} left, {self.steps_per_s / 1e3:.1f}k steps/s, "
            f"reward {reward}, error {self.error_mm:.1f} mm, cost {self.cost:.3f}, "
            f"episode {length}, learning rate {self.learning_rate:.1e}"
        )


class ProgressLine:
    """Prints the newest `Status` to stdout."""

    def __init__(self) -> None:
        self._console = Console()
        self._live = Live(console=self._console, auto_refresh=False)
        self._next_plain = 0.0

    def show(self, status: Status) -> None:
        """Show `status`; the last iteration is always shown."""
        if self._console.is_terminal:
            self._live.start()
            self._live.update(Text(str(status), no_wrap=True, overflow="ellipsis"), refresh=True)
        elif status.iteration >= status.total or time.monotonic() >= self._next_plain:
            self._next_plain = time.monotonic() + PLAIN_EVERY_S
            print(status, flush=True)

    def close(self) -> None:
        """Leave the last live line as it is, and continue below it."""
        self._live.stop()


@contextmanager
def preparing() -> Iterator[None]:
    """While the block runs, print one line if Warp compiles kernels, which takes up to a minute."""
    import warp

    warp.init()
    cache = Path(warp.config.kernel_cache_dir)
    before = _entries(cache)
    done = threading.Event()

    def watch() -> None:
        while not done.wait(CACHE_POLL_S):
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
