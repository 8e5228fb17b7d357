"""The course's programs have no error under `mypy --strict`, except that their functions need no annotations."""

from __future__ import annotations

from pathlib import Path

import pytest
from mypy import api

from tests.public_types import ROOT, write_programs

OPTIONS = ["--strict", "--allow-untyped-defs", "--allow-incomplete-defs", "--allow-untyped-calls", "--config-file="]
LABS = ROOT / "assignments"
STARTERS = sorted({str(file.parent.relative_to(LABS)) for file in LABS.glob("*/starter/**/*.py")})


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("programs")
    write_programs(folder)
    return folder


@pytest.mark.nightly
@pytest.mark.parametrize("part", [".", *STARTERS])
def test_program_has_no_error_under_strict(programs: Path, part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = programs / part.replace("/starter", "")
    monkeypatch.setenv("MYPYPATH", f"{folder}:{programs / 'robots'}")
    out, err, status = api.run([*OPTIONS, f"--cache-dir={programs / 'cache'}", *map(str, folder.glob("*.py"))])
    assert (out.partition(":")[0], err, status) == ("Success", "", 0), out
