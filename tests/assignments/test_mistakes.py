"""Every mistake applies to its reference and changes what it does; one that does not fit fails with its name."""

import ast
from pathlib import Path

import pytest

from tests.assignments import mistakes
from tests.assignments.mistakes import (
    LABS,
    Mistake,
    MistakeError,
    apply,
    mistakes_of,
    remove,
    replace,
    write,
    write_solution,
    write_starter,
)

LAB = "02_depth_hold"
EVERY = [(lab, name) for lab in LABS for name in mistakes_of(lab)]


def program(path: Path) -> bytes | str:
    """Return what a file does: of Python without comments, docstrings and layout."""
    if path.suffix != ".py":
        return path.read_bytes()
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [
                one for one in node.body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))
            ]
    return ast.dump(tree)


def is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def programs(folder: Path) -> dict[str, bytes | str]:
    return {str(path.relative_to(folder)): program(path) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(("lab", "name"), EVERY)
def test_mistake_changes_reference_program(lab: str, name: str, tmp_path: Path) -> None:
    right = programs(write_solution(lab, tmp_path / "reference"))
    assert programs(write_solution(lab, tmp_path / "mistake", name)) != right


@pytest.mark.parametrize("lab", LABS)
def test_mistakes_of_lab_have_texts_and_are_distinct(lab: str, tmp_path: Path) -> None:
    table = mistakes_of(lab)
    assert all(one.what.endswith(".") and one.hint and sum(one.lost.values()) > 0 for one in table.values())
    assert len({one.what for one in table.values()}) == len(table)
    solutions = [programs(write_solution(lab, tmp_path / name, name)) for name in table]
    assert all(solutions.index(one) == i for i, one in enumerate(solutions))


def wrong(*changes: mistakes.Change) -> Mistake:
    return Mistake("Is wrong.", lost={"holds": 30.0}, hint="wrong", changes=changes)


def test_changes_are_applied_in_order(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("x = 1\n")
    (tmp_path / "b.py").write_text("y = 1\n")
    apply(wrong(replace("a.py", "1", "2"), replace("a.py", "2", "3"), remove("b.py"), write("c.npz", b"\0")), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.py": b"x = 3\n", "c.npz": b"\0"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            replace("depth_hold.py", "no such text", ""),
            "depth_hold.py must contain this text once, not 0 times: 'no such",
        ),
        (
            replace("depth_hold.py", "MAX_FORCE_N", "1"),
            "depth_hold.py must contain this text once, not 3 times: 'MAX_FORCE_N'",
        ),
        (replace("depht_hold.py", "a", "b"), "depht_hold.py is neither in the starter nor in the reference"),
        (remove("policy.npz"), "policy.npz is neither in the starter nor in the reference"),
    ],
)
def test_mismatched_change_reports_lab_mistake_file_and_count(
    change: mistakes.Change, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(mistakes_of(LAB), "sign_error", wrong(change))
    with pytest.raises(MistakeError, match=f"^Lab 02_depth_hold, mistake sign_error: {message}"):
        write_solution(LAB, tmp_path, "sign_error")


def test_solution_combines_starter_reference_and_mistake(tmp_path: Path) -> None:
    starter, alone = write_starter(LAB, tmp_path / "starter"), write_solution(LAB, tmp_path / "alone", starter=False)
    assert [path.name for path in alone.iterdir()] == ["depth_hold.py"]
    solved = programs(write_solution(LAB, tmp_path / "solved"))
    assert solved == {**programs(starter), **programs(alone)}
    mistaken = programs(write_solution(LAB, tmp_path / "mistaken", "sign_error"))
    assert {name for name in solved if mistaken[name] != solved[name]} == {"depth_hold.py"}
