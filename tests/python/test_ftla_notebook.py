"""The notebook of appendix H derives what is compiled; `test_book` sees that all notebooks run."""

from pathlib import Path

import nbclient
import nbformat
import pytest

NOTEBOOK = Path(__file__).parents[2].joinpath("python", "notebooks", "appendix_h.ipynb")


@pytest.mark.filterwarnings("default")  # those of Jupyter are not ours
def test_the_derived_field_and_jacobian_are_the_compiled_ones_to_1e_12() -> None:
    read = nbformat.read(NOTEBOOK, as_version=4)  # type: ignore[no-untyped-call]
    notebook = nbclient.NotebookClient(read, timeout=300, kernel_name="python3").execute()
    # what it prints last: the differences of field, Jacobian and Hamiltonian from the compiled ones
    printed = "".join(output.text for output in notebook.cells[-1].outputs)
    found = dict(line.split(": ") for line in printed.strip().splitlines())
    assert set(found) == {"field", "Jacobian", "Hamiltonian"}
    assert all(float(value) < 1e-12 for value in found.values())
