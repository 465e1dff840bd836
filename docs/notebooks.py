"""Runs the notebooks and stores what they show in them: `make notebooks`, or with the names of some of them.

Who reads a notebook on a page sees its outputs and runs nothing. Pictures are small; a scene of the viewer,
which such a page does not play, is a still that Chromium draws. Numbers of executions, times and versions are
left out, so that a notebook that is run again changes only where its outputs do.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

import somersault
from somersault import ocp

FOLDER = Path(__file__).parents[1] / "python" / "notebooks"
#: The dive that its notebook loads, since finding it takes long; found anew with that notebook.
DIVE = FOLDER / "dive_5174d.som"

#: What runs before a notebook, and is not stored.
_BEFORE = """
figure = {"dpi": 80, "bbox_inches": "tight", "metadata": {"Software": None}}
%config InlineBackend.print_figure_kwargs = figure

from somersault.viewer import Scene, film


def still(scene):
    start, end = scene.interval
    return film.pictures(scene, [0.4 * (end - start)], (640, 400))[0]


Scene._repr_html_, Scene._repr_png_ = None, still
"""
_METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def run(path: Path) -> None:
    """Runs a notebook and writes it with its outputs."""
    notebook: Any = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(_BEFORE))
    resources = {"metadata": {"path": str(FOLDER)}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=resources).execute()
    del notebook.cells[0]
    notebook.metadata = _METADATA
    for cell in notebook.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            cell.execution_count = None
            for output in cell.outputs:
                output.pop("execution_count", None)
                if output.output_type == "execute_result":
                    output.execution_count = None
                if "metadata" in output:
                    output.metadata = {}
    nbformat.write(notebook, path)


def main() -> None:
    chosen = sys.argv[1:] or sorted(path.stem for path in FOLDER.glob("*.ipynb"))
    if "dives" in chosen:
        somersault.save(DIVE, ocp.dive_5174d().solve())
    for name in chosen:
        path = FOLDER / f"{name}.ipynb"
        run(path)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
