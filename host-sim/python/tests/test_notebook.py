"""The notebook from flights to an explained model runs."""

import os
import pathlib
import shutil

import nbformat
from nbclient import NotebookClient

NOTEBOOK = pathlib.Path(__file__).parents[1] / "notebooks/from_flights_to_a_model.ipynb"


def test_the_notebook_runs(tmp_path, vehicle):
    folder = tmp_path / "python/notebooks"
    folder.mkdir(parents=True)
    shutil.copytree(vehicle.parent, tmp_path / "model/vehicles")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    # Whatever Jupyter writes about itself stays here.
    os.environ["JUPYTER_RUNTIME_DIR"] = os.environ["IPYTHONDIR"] = str(tmp_path)
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}).execute()
    pictures = [output for cell in notebook.cells for output in cell.get("outputs", []) if "image/png" in output.get("data", {})]
    assert len(pictures) == 3
    assert (folder / "model.toml").is_file()
