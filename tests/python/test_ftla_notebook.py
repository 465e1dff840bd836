"""The notebooks run from a clean kernel, and are kept without outputs."""

from pathlib import Path
from typing import Any

import nbclient
import nbformat
import pytest

NOTEBOOKS = sorted(Path(__file__).parents[2].joinpath("python", "notebooks").glob("*.ipynb"))


def read(path: Path) -> Any:
    return nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]


def test_there_are_notebooks() -> None:
    assert "appendix_h.ipynb" in {path.name for path in NOTEBOOKS}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_kept_without_outputs(path: Path) -> None:
    cells = [cell for cell in read(path).cells if cell.cell_type == "code"]
    assert cells and all(not cell.outputs and cell.execution_count is None for cell in cells)


@pytest.mark.filterwarnings("default")  # those of Jupyter are not ours
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_from_a_clean_kernel(path: Path) -> None:
    notebook = nbclient.NotebookClient(read(path), timeout=300, kernel_name="python3").execute()
    assert all(cell.execution_count for cell in notebook.cells if cell.cell_type == "code")
    if path.stem == "appendix_h":
        # what it prints last: the differences of field, Jacobian and Hamiltonian from the compiled ones
        printed = "".join(output.text for output in notebook.cells[-1].outputs)
        found = dict(line.split(": ") for line in printed.strip().splitlines())
        assert set(found) == {"field", "Jacobian", "Hamiltonian"}
        assert all(float(value) < 1e-12 for value in found.values())
