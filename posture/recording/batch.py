"""Many recordings, shared among the processors."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from envs.body.segments import Segments
from posture.config.analyse import AnalyseConfig
from posture.operating_system import block_signals
from posture.recording.trial import Trial, analyse

SERIAL = 8
"""Up to this many recordings are analysed in this process, since others take a second to start."""


@dataclass(frozen=True)
class Analyst:
    """Analyses one file after another, in this process or in another."""

    config: AnalyseConfig
    body: Segments | None
    figures: bool

    def __call__(self, path: Path) -> tuple[Trial, bytes]:
        """The trial in a file, and its figure as a PNG; b"" without figures."""
        analysed = analyse(path, self.config, self.body)
        if not self.figures:
            return analysed.trial, b""
        from posture.recording.figures import png, recording_figure  # matplotlib takes a second

        return analysed.trial, png(recording_figure(analysed))


def analyse_all(paths: Sequence[Path], config: AnalyseConfig, body: Segments | None) -> list[tuple[Trial, bytes]]:
    """The trials of all files and their figures, in order; b"" for those without one. See
    `posture.recording.trial.analyse`."""
    figures = config.evaluation.figures and len(paths) <= config.own_figures
    analyst, processes = Analyst(config, body, figures), os.cpu_count() or 1
    if len(paths) <= SERIAL or processes == 1:
        return [analyst(path) for path in paths]
    with ProcessPoolExecutor(min(processes, len(paths)), get_context("spawn")) as pool:
        try:
            with block_signals((signal.SIGINT,)):  # Ctrl-C reaches all processes of a terminal; this one is enough
                found = pool.map(analyst, paths)
            return list(found)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)  # one bad file is enough
            raise
