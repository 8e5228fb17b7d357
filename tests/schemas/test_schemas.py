"""The schemas ship, are schemas, and are those that the classes make; results are valid, too."""

import importlib.resources
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from snr_sim.schemas import FOLDER, NAMES, SUFFIX, read_schema
from snr_sim.schemas.generate import generated

Validator = Callable[..., Callable[[Any], bool]]
ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", NAMES)
def test_schema_is_valid_and_found_as_resource(name: str) -> None:
    schema = read_schema(name)
    Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == Draft202012Validator.META_SCHEMA["$id"]
    file = importlib.resources.files("snr_sim.schemas") / f"{name}{SUFFIX}"
    assert json.loads(file.read_text(encoding="utf-8")) == schema


def test_schema_files_equal_listed_names() -> None:
    assert sorted(path.name.removesuffix(SUFFIX) for path in FOLDER.glob("*.json")) == sorted(NAMES)


@pytest.mark.parametrize("name", generated())
def test_shipped_schema_equals_generated_schema(name: str) -> None:
    shipped = (FOLDER / f"{name}{SUFFIX}").read_text(encoding="utf-8")
    assert shipped == generated()[name], "run: python -m snr_sim.schemas --write"


@pytest.mark.slow
def test_schemas_module_prints_existing_paths() -> None:
    done = subprocess.run([sys.executable, "-m", "snr_sim.schemas"], capture_output=True, text=True, check=True)
    assert [Path(line).name for line in done.stdout.splitlines()] == [f"{name}{SUFFIX}" for name in NAMES]
    assert all(Path(line).is_file() for line in done.stdout.splitlines())


@pytest.mark.parametrize("name", NAMES)
def test_formats_page_names_each_schema(name: str) -> None:
    assert f"`{name}{SUFFIX}`" in (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_results_of_all_outcomes_are_valid(validator: Validator, tmp_path: Path) -> None:
    is_valid = validator("result")
    shown = []
    for words in (
        ["run", "lander_low_gate", "--out", "ended"],
        ["run", "lander_low_gate", "--out", "failed", "--controller", "fails.py"],
        ["run", "lander_low_gate", "--out", "never", "--controller", "no_such"],
    ):
        (tmp_path / "fails.py").write_text(FAILS)
        command = [sys.executable, "-m", "snr_sim", *words, "--json", *(["--no-rrd"] if words[0] == "run" else [])]
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
        shown.append(json.loads(done.stdout))
    assert [one.get("outcome") for one in shown] == ["landed", "error", None]
    assert [one for one in shown if not is_valid(one)] == []
    kept = [json.loads(path.read_bytes()) for path in sorted(tmp_path.glob("*/*/result.json"))]
    assert len(kept) == 2
    assert all(map(is_valid, kept))
    for field in ("seed", "success", "outcome", "trace_digest", "notes", "scenario"):
        assert not is_valid({name: value for name, value in shown[0].items() if name != field})
        assert not is_valid(shown[0] | {field: None})
    assert not is_valid(shown[2] | {"more": 1})


FAILS = """
from snr_sim import Endpoint, EndpointFactory, TaskType


class Failing(Endpoint):
    def begin(self):
        raise ValueError("by the student")


class FailingFactory(EndpointFactory):
    def get(self, parent):
        return Failing(self, parent, "failing")


def factories(robot):
    return [FailingFactory()]
"""
