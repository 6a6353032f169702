"""The notebooks in examples/ run, show the scene inline and are stored without outputs."""

import shutil
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

EXAMPLES = Path(__file__).parents[2] / "examples"
NUMBERS = {
    "first_map": "max |E| 51.7 µm at (21, 21, 21) nodes",
    "measured_data_to_compensation": "max |E| 67.2 µm before compensation, 0.71 µm after it",
    "tolerances_to_limit": "general tolerance: 60.3 % of the machines pass",
}


def outputs(notebook):
    return [output for cell in notebook.cells for output in cell.get("outputs", ())]


@pytest.mark.nightly
@pytest.mark.parametrize("name", NUMBERS)
def test_notebook(name, tmp_path, monkeypatch):
    for variable in ("IPYTHONDIR", "JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR"):
        monkeypatch.setenv(variable, str(tmp_path / variable))
    shutil.copytree(EXAMPLES / "data", tmp_path / "data")
    notebook = nbformat.read(EXAMPLES / f"{name}.ipynb", as_version=4)
    assert outputs(notebook) == []
    client = NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    pages = [output.get("data", {}).get("text/html", "") for output in outputs(notebook)]
    assert sum(page.startswith("<iframe ") for page in pages) == 1
    printed = "".join(output.get("text", "") for output in outputs(notebook))
    assert NUMBERS[name] in printed
    assert "viser" not in str([{**output, "data": ""} for output in outputs(notebook)])


def test_every_notebook_runs():
    assert {path.stem for path in EXAMPLES.glob("*.ipynb")} == NUMBERS.keys()
