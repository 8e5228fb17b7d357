"""`snr bench`: it runs and prints its results; the speed itself is not tested."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from snr_sim.prelude.errors import ParameterError
from tests.bench.history import append_result, read_history, slower_rows

BENCH = Path(__file__).parents[1] / "bench"
ALL = sorted(path.stem.removeprefix("bench_") for path in BENCH.glob("bench_*.py"))


def snr_bench(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "snr_sim", "bench", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ALL)
def test_every_benchmark_runs_and_reports_missing_packages(tmp_path: Path, name: str) -> None:
    done = snr_bench(tmp_path, name, "--quick", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["failed"] == []
    assert found["rows"] or found["skipped"]
    assert all(row["value"] >= 0.0 for row in found["rows"])
    assert all(row["skipped"] for row in found["skipped"])


@pytest.mark.slow
def test_quick_run_json_contains_machine_and_rows(tmp_path: Path) -> None:
    done = snr_bench(tmp_path, "pages", "--quick", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert {"cpu", "cores", "python", "packages", "date"} <= set(found["machine"])
    assert all(row["subject"] == "pages" and row["value"] > 0 for row in found["rows"])
    assert {row["limit"] for row in found["rows"]} == {2.5, 2.0}
    (kept,) = read_history(tmp_path / "runs" / "bench.jsonl")
    assert kept["rows"] == found["rows"]


@pytest.mark.slow
def test_unknown_benchmark_suggests_nearest_name(tmp_path: Path) -> None:
    done = snr_bench(tmp_path, "dispach")
    assert done.returncode == 2
    assert "dispatch" in done.stderr


ROW = 'Row("a step", 2.0, "us", ratio=1.5, ratio_limit=2.0)'
FILES = {
    "fails": f"def measure(is_quick):\n    yield {ROW}\n    raise RuntimeError('no such neutral')\n",
    "lacks": "import a_package_that_nobody_has\n",
    "partly": "from snr_sim import Config, Node\nfrom snr_sim.prelude.errors import MissingExtraError\n"
    "from snr_sim.testing.function_components import FunctionLoopFactory\n"
    "def lacking():\n    raise MissingExtraError('pyserial', 'io')\n    yield\n"
    "def lacking_in_a_node():\n    loop = FunctionLoopFactory(lambda loop: next(lacking()), 'pilot', 10.0)\n"
    "    Node('r', Config(factories={'r': [loop]})).loop()\n    yield\n"
    "def measure(is_quick):\n    yield from what_can_run('the line', lacking)\n"
    "    yield from what_can_run('the pilot', lacking_in_a_node)\n"
    f"    yield {ROW}\n",
}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A checkout with benchmarks of which one fails, one lacks a package, and one lacks it in part."""
    bench = tmp_path / "tests" / "bench"
    bench.mkdir(parents=True)
    for name in ("harness.py", "history.py", "report.py", "run.py"):
        (bench / name).write_text((BENCH / name).read_text())
    for name, code in FILES.items():
        (bench / f"bench_{name}.py").write_text(f"from harness import Row, what_can_run\n{code}")
    return tmp_path


@pytest.mark.slow
def test_results_are_printed_although_one_benchmark_fails(project: Path) -> None:
    done = snr_bench(project, "--quick")
    assert done.returncode == 2
    assert done.stdout.count("a step") == 2  # also that of the one that failed later
    assert "skipped: lacks: No module named 'a_package_that_nobody_has'" in done.stdout
    assert "skipped: the line:" in done.stdout
    assert "skipped: the pilot: This needs the package 'pyserial'" in done.stdout
    assert "RuntimeError: no such neutral" in done.stderr
    assert "The benchmark 'fails' stopped with status 1" in done.stderr


@pytest.mark.slow
def test_second_run_is_compared_with_first_as_json(project: Path) -> None:
    first = snr_bench(project, "partly", "--json", "--history", "h.jsonl")
    assert (first.returncode, json.loads(first.stdout)["slower"]) == (0, [])
    bench = project / "tests" / "bench" / "bench_partly.py"
    bench.write_text(bench.read_text().replace("ratio=1.5", "ratio=1.80"))  # longer: its bytecode may be of this second
    second = snr_bench(project, "--json", "--history", "h.jsonl")
    assert second.returncode == 2  # as one fails
    found = json.loads(second.stdout)
    assert [one["subject"] for one in found["failed"]] == ["fails"]
    assert {row["name"] for row in found["skipped"]} == {"lacks", "the line", "the pilot"}
    (slower,) = found["slower"]
    assert (slower["subject"], slower["ratio"], slower["before"]) == ("partly", 1.8, 1.5)
    assert "partly: a step is slower: 1.80 x the bare version, 1.50 x before" in second.stderr
    assert len(read_history(project / "h.jsonl")) == 2


def result(ratios: Sequence[float | None], cpu: str = "one", options: Sequence[str] = ()) -> dict[str, Any]:
    rows = [{"subject": "lander", "name": f"row {i}", "ratio": ratio} for i, ratio in enumerate(ratios)]
    return {"machine": {"cpu": cpu, "cores": 2, "python": "3.11.7"}, "options": list(options), "rows": rows}


def test_ratio_10_percent_above_median_of_last_five_is_slower() -> None:
    history = [result([9.0, 1.0]), *(result([ratio, 1.0]) for ratio in (1.0, 1.0, 2.0, 1.0, 1.0))]
    assert [row["name"] for row in slower_rows(history, result([1.11, 1.09]))] == ["row 0"]
    assert slower_rows(history, result([1.11, 1.0]))[0]["slower_by"] == pytest.approx(1.11)


def test_results_of_other_machine_or_quick_runs_are_not_compared() -> None:
    history = [result([1.0], cpu="another"), result([1.0], options=["--quick"]), result([None])]
    assert slower_rows(history, result([3.0])) == []
    assert slower_rows([result([1.0])], result([None])) == []


def test_truncated_history_line_is_skipped(tmp_path: Path) -> None:
    path = tmp_path / "new" / "bench.jsonl"
    assert read_history(path) == []
    append_result(path, result([1.0]))
    path.write_text(path.read_text() + '{"rows": [\n[]\n')
    append_result(path, result([2.0]))
    assert [one["rows"][0]["ratio"] for one in read_history(path)] == [1.0, 2.0]


def test_unwritable_history_reports_error(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="cannot be written: Is a directory"):
        append_result(tmp_path, result([1.0]))
