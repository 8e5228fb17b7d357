"""What decides a run is computed by what rounds alike under every Python and on every processor.

A line that is right all the same says why in a comment: `# exact: integers` where nothing is rounded, and
`# decides no run: ...` where the result enters no trace, or only as what is accepted or not.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import snr_sim

ROOT = Path(snr_sim.__file__).parents[1]
FOLDERS = [
    *(f"snr_sim/{room}" for room in ("prelude", "core", "std_mods", "devices", "plants", "behaviors")),
    "robots",
    "scenarios",
]
REASON = re.compile(r"# (exact: (integers|fractions)|decides no run: \w+)")

# Python 3.12 made `sum` of floats compensated, and built `statistics.fmean` with weights on it.
OF_PYTHON = {"sum": "ordered_sum of prelude/sums.py", "sumprod": "dot_product of prelude/sums.py"}
# numpy's OpenBLAS picks other code for other processors.
OF_BLAS = {"dot", "vdot", "inner", "matmul", "tensordot", "einsum", "linalg"}
# numpy has code of its own for these for processors with AVX-512. `math` has the C library's, one value at a time.
OF_NUMPY = {"sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh", "hypot", "power"}
OF_NUMPY |= {"exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "cbrt"}
# What `sum` may add: counts.
COUNTS = {"len", "int", "isinstance", "callable", "bool"}


def is_count(node: ast.expr) -> bool:
    """Return whether an operand is obviously an integer or a boolean."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int)
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.op, ast.Not) or is_count(node.operand)
    if isinstance(node, ast.Call):
        name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
        return name in COUNTS or name.startswith("is")
    if isinstance(node, ast.Attribute):
        return node.attr.startswith(("is_", "has_"))
    if isinstance(node, ast.Name):
        return node.id.startswith(("is_", "has_"))
    return isinstance(node, ast.Compare)


def adds_counts(call: ast.Call) -> bool:
    """Return whether a call of `sum` adds nothing but counts."""
    (added, *_) = call.args
    if isinstance(added, (ast.GeneratorExp, ast.ListComp)):
        return is_count(added.elt)
    is_map = isinstance(added, ast.Call) and isinstance(added.func, ast.Name) and added.func.id == "map"
    return is_map and isinstance(added.args[0], ast.Name) and added.args[0].id in COUNTS


def found_in(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and message of each operation that may round differently elsewhere."""
    lines = source.splitlines()
    tree = ast.parse(source)
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        message = ""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in OF_PYTHON:
            if node.func.id != "sum" or not adds_counts(node):
                message = f"{node.func.id}() differs between versions of Python: use {OF_PYTHON[node.func.id]}"
        elif isinstance(node, ast.Name) and node.id in OF_PYTHON and id(node) not in called:  # handed on, or in a table
            message = f"{node.id} differs between versions of Python: use number_sum of prelude/sums.py"
        elif isinstance(node, (ast.BinOp, ast.AugAssign)) and isinstance(node.op, ast.MatMult):
            message = "`@` differs between processors: use plants/matrices.py, or write it out"
        elif isinstance(node, ast.Attribute) and node.attr in OF_BLAS:
            message = f"numpy's {node.attr} differs between processors: use plants/matrices.py, or write it out"
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("np", "numpy"):
            if node.attr in OF_NUMPY:
                message = f"np.{node.attr} differs between processors: use math.{node.attr} on single numbers"
        elif isinstance(node, ast.Attribute) and node.attr == "sumprod":
            message = f"sumprod is not in Python 3.11: use {OF_PYTHON['sumprod']}"
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names = [getattr(node, "module", None) or "", *(alias.name for alias in node.names)]
            if "statistics" in names:
                message = "statistics differs between versions of Python: use ordered_sum or math.fsum"
        if message and not REASON.search("\n".join(lines[node.lineno - 1 : node.end_lineno])):
            yield node.lineno, message


def test_no_operation_that_decides_a_run_rounds_differently_elsewhere() -> None:
    found = []
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            found += [f"{name}:{line}: {message}" for line, message in found_in(path.read_text(encoding="utf-8"))]
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize(
    "line",
    [
        "sum(values)",
        "sum(a * b for a, b in pairs)",
        "sum(map(abs, values))",
        "FUNCTIONS = {'sum': sum}",
        "map(sum, rows)",
        "turn @ place",
        "turn @= place",
        "np.linalg.inv(mass)",
        "matrix.dot(forces)",
        "np.sin(angles)",
        "math.sumprod(a, b)",
        "from statistics import fmean",
        "import statistics",
    ],
)
def test_an_operation_that_may_round_differently_is_found(line: str) -> None:
    assert [number for number, _ in found_in(f"import math\n{line}\n")] == [2]


@pytest.mark.parametrize(
    "line",
    [
        "sum(1 for one in many)",
        "sum(value > 0.0 for value in values)",
        "sum(one.is_known for one in many)",
        "sum(map(len, chunks))",
        "sum(int(one) for one in many)",
        "sum(counts)  # exact: integers",
        "turn @ place  # decides no run: only checked",
        "values.sum()",
        "math.hypot(x, y)",
    ],
)
def test_portable_operation_passes(line: str) -> None:
    assert not list(found_in(f"{line}\n"))
