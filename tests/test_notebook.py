"""The notebooks of the documentation run, and what their text says comes out."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).resolve().parents[1] / "docs" / "notebooks"

SWITCH = """
paper = {0.15: "in-phase", 0.3: "in-phase", 0.45: "in-phase", 0.6: "in-phase", 0.75: "anti-phase", 0.9: "anti-phase",
         1.2: "anti-phase"}  # Table 3
assert {row.freq_hz: row.mode for row in rows if row.freq_hz in paper} == paper
assert abs(measured - switch) < 0.1
assert soft_switch is None and {row.mode for row in soft} == {"anti-phase"}
assert loaded_measured < measured and loaded_switch < switch
"""
PEOPLE = """
assert one.trial.indices.mode == "in-phase" and one.trial.indices.cycles_left_out == 1
assert indices.mode == "anti-phase"  # with one sign reversed, the last of the three
assert [(row.subject, row.r_mean > 0) for row in rows if row.subject == ALL] == [(ALL, True), (ALL, False)]
assert all(abs(found - 0.65) < 0.05 for found in (ramp.transition_centred_hz, change.change_point_hz))
assert predicted[0] > 0.9 and predicted[-1] < -0.9
"""
CASES = {"switch": (SWITCH, 4), "people": (PEOPLE, 3)}
"""Claims of each notebook, and its number of figures."""


def read(name):
    return nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)


def test_all_are_tested():
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == set(CASES)


@pytest.mark.parametrize("name", CASES)
def test_it_is_committed_without_outputs(name):
    notebook = read(name)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert cell.cell_type == "markdown" or (not cell.outputs and cell.execution_count is None)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_it_runs_and_its_claims_hold(name, tmp_path):
    notebook = read(name)
    claims, figures = CASES[name]
    notebook.cells.append(nbformat.v4.new_code_cell(claims))
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert not list(tmp_path.iterdir())
    assert sum("image/png" in out.get("data", {}) for cell in notebook.cells for out in cell.get("outputs", ())) == figures
