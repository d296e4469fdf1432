"""The notebook of the documentation runs, and what its text says comes out."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).resolve().parents[1] / "docs" / "notebooks" / "switch.ipynb"

CLAIMS = """
paper = {0.15: "in-phase", 0.3: "in-phase", 0.45: "in-phase", 0.6: "in-phase", 0.75: "anti-phase", 0.9: "anti-phase",
         1.2: "anti-phase"}  # Table 3
assert {row.freq_hz: row.mode for row in rows if row.freq_hz in paper} == paper
assert abs(measured - switch) < 0.1
assert soft_switch is None and {row.mode for row in soft} == {"anti-phase"}
assert loaded_measured < measured and loaded_switch < switch
"""


def read():
    return nbformat.read(NOTEBOOK, as_version=4)


def test_it_is_committed_without_outputs():
    notebook = read()
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert cell.cell_type == "markdown" or (not cell.outputs and cell.execution_count is None)


@pytest.mark.slow
def test_it_runs_and_its_claims_hold(tmp_path):
    notebook = read()
    notebook.cells.append(nbformat.v4.new_code_cell(CLAIMS))
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert not list(tmp_path.iterdir())
    assert sum("image/png" in out.get("data", {}) for cell in notebook.cells for out in cell.get("outputs", ())) == 4
