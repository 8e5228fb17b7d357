"""The notebooks run from top to bottom, as committed: without outputs, and without hidden state."""

import json
import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
FRAMES = {"01_landing": 1, "02_underwater": 1, "04_replay": 2}  # in which the rerun viewer shows a recorded run


def test_notebooks_are_six_and_listed_in_readme() -> None:
    names = ["landing", "underwater", "filters", "replay", "grading", "live_programming"]
    assert [one.stem[3:] for one in NOTEBOOKS] == names
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert all(one.name in page for one in NOTEBOOKS)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_stored_without_outputs(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    notebook = json.loads(text)
    nbformat.validate(nbformat.reads(text, 4))
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert (cell["outputs"], cell["execution_count"]) == ([], None)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_cell_ids_are_unique_and_numbered(path: Path) -> None:
    names = [cell["id"] for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(path.stem[:2] + r"-\d\d", name) for name in names)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # those of jupyter's own parts
@pytest.mark.parametrize(
    "path",
    [
        # They grade a class, and explore a room four times: tests of grading and of lab 12 do so before each landing.
        pytest.param(path, marks=pytest.mark.nightly) if path.stem in ("05_grading", "06_live_programming") else path
        for path in NOTEBOOKS
    ],
    ids=lambda path: path.stem,
)
def test_notebook_runs_and_shows_pictures(path: Path) -> None:
    notebook = nbformat.read(path, 4)
    # A cell that takes minutes is not for a class; the limit is far above, for a busy computer.
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(FOLDER)}}).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not [output for output in shown if output.output_type == "error"]
    assert sum("image/png" in output.get("data", {}) for output in shown) >= 1
    framed = sum("<iframe" in "".join(output.get("data", {}).get("text/html", "")) for output in shown)
    assert framed == FRAMES.get(path.stem, 0)
