"""Figures and films look the same whatever a user has set for matplotlib."""

import os
import subprocess
import sys

import matplotlib
import numpy as np
import pytest

from posture.analysis import figures
from posture.reproduce.figures.seed_curves import report_figure
from tests.posture.analysis.test_figures import PAPER, SPAN, sweep
from tests.posture.analysis.trials import measured
from tests.posture.film.test_film import film_of, swaying_trial

USERS = {
    "text.usetex": True,
    "savefig.format": "svg",
    "savefig.bbox": "tight",
    "savefig.transparent": True,
    "figure.autolayout": True,
    "figure.facecolor": "black",
    "axes.xmargin": 0.4,
    "axes.formatter.use_locale": True,
    "lines.linewidth": 6.0,
    "font.family": "monospace",
    "ytick.labelleft": False,
}


def pictures(folder):
    """Bytes of all figures of an evaluation, of one of the report, and of a frame of a film."""
    trajectory = sweep([0.3, 0.9])
    paths = figures.draw_all(trajectory, measured(trajectory), PAPER, folder, SPAN)
    with report_figure(2.0, folder / "report.png") as fig:
        fig.subplots().plot([0, 1000], [1e-3, 2e-3])
    frame = film_of(swaying_trial(0.0))[3]
    return [path.read_bytes() for path in (*paths, folder / "report.png")] + [np.asarray(frame).tobytes()]


def test_settings_of_a_user_change_nothing(tmp_path):
    expected = pictures(tmp_path / "plain")
    with matplotlib.rc_context(USERS):
        assert pictures(tmp_path / "user") == expected


@pytest.mark.parametrize("backend", ["module://matplotlib_inline.backend_inline", "module://missing", "TkAgg"])
def test_any_backend_may_be_set(tmp_path, backend):
    """A notebook sets one that its own Python has."""
    code = (
        "import sys; from posture.cli import console\n"
        "sys.argv = ['posture', 'eval', '--cfg', 'job']; console.main()\n"
        "import matplotlib; assert matplotlib.get_backend() == 'agg'"
    )
    env = os.environ | {"MPLBACKEND": backend}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
