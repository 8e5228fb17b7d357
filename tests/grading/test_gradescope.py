"""Gradescope container: run here, with a root other than /autograder, and with the snr_sim that it contains."""

import json
import os
import re
import shutil
import stat
import subprocess
import sys
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading.batch.gradescope import requirements

HandedIn = Callable[..., list[Path]]


@pytest.fixture
def container(double_lab: Path, tmp_path: Path) -> Path:
    """Create /autograder as in Gradescope before a submission arrives, without the packages of setup.sh."""
    (tmp_path / "the_secret").write_text("correct horse battery staple")
    words = ["grade", str(double_lab), "--gradescope", str(tmp_path / "made"), "--isolation", "none"]
    made = subprocess.run(
        [sys.executable, "-m", "snr_sim", *words, "--secret", str(tmp_path / "the_secret"), "--json"],
        capture_output=True,
        text=True,
    )
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout) == {"out": str(tmp_path / "made")}
    shutil.copytree(tmp_path / "made", tmp_path / "autograder" / "source")
    shutil.rmtree(double_lab)  # the container has its own copy
    return tmp_path / "autograder"


def run(
    root: Path, submission: Path | None, python: str = sys.executable, prefix: Sequence[str] = ()
) -> dict[str, Any]:
    shutil.rmtree(root / "submission", ignore_errors=True)
    if submission is None:
        (root / "submission").mkdir()
    else:
        shutil.copytree(submission, root / "submission")
    environment = {**os.environ, "AUTOGRADER_ROOT": str(root), "AUTOGRADER_PYTHON": python}
    environment["PYTHONPATH"] = str(root / "source" / "kit")
    command = [*prefix, "bash", root / "source" / "run_autograder"]
    subprocess.run(command, env=environment, check=True, capture_output=True)
    fields: dict[str, Any] = json.loads((root / "results" / "results.json").read_text())
    return fields


@pytest.mark.slow
def test_container_grades_a_submission(container: Path, handed_in: HandedIn) -> None:
    right, visible_only = handed_in(ada="right", bob="visible_only")
    first = run(container, right)
    assert (first["score"], [test["score"] for test in first["tests"]]) == (100.0, [40.0, 60.0])
    second = run(container, visible_only)
    assert second["score"] == 70.0
    assert "0 of 1 passed" in second["tests"][1]["output"]
    assert "not kept apart" in second["output"]


@pytest.mark.slow
def test_ordinary_container_grades_confined(
    container: Path, handed_in: HandedIn, docker: list[str], open_folder: Path
) -> None:
    """As Gradescope runs it: as root without namespaces, and without an option to skip isolation."""
    root = open_folder / "autograder"
    shutil.copytree(container, root)
    lab = json.loads((root / "source" / "settings.json").read_text())["lab"]
    (root / "source" / "settings.json").write_text(json.dumps({"lab": lab, "isolation": "required"}))
    attack = Path(__file__).parent / "attacks" / "looks_around.py"
    right, looks_around = handed_in(ada="right", eve=attack.read_text())
    results = run(root, right, prefix=docker)
    assert (results["score"], results["extra_data"]["isolation"]) == (100.0, "confined")
    assert "not kept apart" not in results.get("output", "")
    assert run(root, looks_around, prefix=docker)["score"] == 0.0
    assert [path.name for path in open_folder.iterdir()] == ["autograder"]


@pytest.mark.slow
def test_setup_continues_without_bubblewrap(container: Path) -> None:
    (line,) = [line for line in (container / "source" / "setup.sh").read_text().splitlines() if "bubblewrap" in line]
    failing = f"set -e\napt-get() {{ false; }}\n{line}\necho continued"
    assert "continued" in subprocess.run(["bash", "-c", failing], check=True, capture_output=True, text=True).stdout


@pytest.mark.slow
def test_results_file_exists_after_any_failure(container: Path, handed_in: HandedIn) -> None:
    assert run(container, None)["score"] == 0
    assert "empty" in run(container, None)["output"]
    (fault,) = handed_in(eve="finds_a_fault")
    results = run(container, fault)
    assert "score" not in results
    assert "not you" in results["output"]
    (container / "results" / "results.json").unlink()
    broken = run(container, fault, python="/bin/false")
    assert "score" not in broken
    assert "not you" in broken["output"]


@pytest.mark.slow
def test_container_contains_only_required_files(container: Path) -> None:
    source = container / "source"
    assert stat.S_IMODE((source / "secret").stat().st_mode) == 0o600
    assert all(os.access(source / name, os.X_OK) for name in ("setup.sh", "run_autograder"))
    for name in ("setup.sh", "run_autograder"):
        subprocess.run(["bash", "-n", source / name], check=True)
    labs = list((source / "kit" / "snr_sim" / "shipped" / "assignments").iterdir())
    assert [lab.name for lab in labs] == ["01_double"]
    assert sum(path.stat().st_size for path in source.rglob("*")) < 20e6
    assert not list(source.rglob("*.pyc"))


def test_requirements_are_the_base_and_sim_extras() -> None:
    names = {re.split(r"[<>=\[]", line)[0].strip() for line in requirements()}
    assert {"msgspec", "typer", "rich", "numpy", "pymunk", "mujoco-core"} <= names
    assert names.isdisjoint({"pytest", "rerun-sdk", "mypy"})


@pytest.mark.slow
def test_container_in_a_non_empty_folder_raises(double_lab: Path, tmp_path: Path) -> None:
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "thesis.tex").write_text("x")
    words = ["grade", str(double_lab), "--gradescope", str(tmp_path / "made")]
    done = subprocess.run([sys.executable, "-m", "snr_sim", *words], capture_output=True, text=True)
    assert done.returncode == 2
    assert "is not empty" in done.stderr
    assert [path.name for path in (tmp_path / "made").iterdir()] == ["thesis.tex"]


@pytest.mark.slow
def test_submitted_archive_is_unpacked(container: Path, handed_in: HandedIn, tmp_path: Path) -> None:
    (right,) = handed_in(ada="right")
    (tmp_path / "given").mkdir()
    with zipfile.ZipFile(tmp_path / "given" / "work.zip", "w") as archive:
        archive.write(right / "double.py", "work/double.py")
    assert run(container, tmp_path / "given")["score"] == 100.0
