"""Landlock: granted paths can be opened, and nothing else; a folder can be excluded from a granted one."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from snr_sim.grading.sandbox.confinement import READ, READ_DIR, paths_except

SCRIPT = """
import ctypes, json, sys
from pathlib import Path
from snr_sim.grading.sandbox.confinement import LandlockMissingError, SCRATCH, paths_except, restrict

tree = Path(sys.argv[1])
ctypes.CDLL(None).prctl(38, 1, 0, 0, 0)
try:
    kit = dict(paths_except(tree / "kit", tree / "kit" / "a" / "labs"))
    restrict({**kit, tree / "scratch": SCRATCH, tree / "absent": SCRATCH})
except LandlockMissingError as missing:
    print(json.dumps(str(missing)))
    sys.exit()


def tried(what, *args):
    try:
        what(*args)
    except OSError as error:
        return type(error).__name__
    return "done"


print(json.dumps({
    "kit": tried((tree / "kit" / "a" / "file").read_text),
    "labs": tried((tree / "kit" / "a" / "labs" / "file").read_text),
    "beside": tried((tree / "file").read_text),
    "write": tried((tree / "kit" / "a" / "file").write_text, "x"),
    "scratch": tried((tree / "scratch" / "new").write_text, "x"),
    "folder": tried((tree / "scratch" / "folder").mkdir),
}))
"""


def made(folder: Path) -> Path:
    (folder / "scratch").mkdir()
    (folder / "kit" / "a" / "labs").mkdir(parents=True)
    (folder / "kit" / "b").mkdir()
    for path in ("file", "kit/a/file", "kit/a/labs/file"):
        (folder / path).write_text(path)
    return folder


def test_paths_except_grants_siblings_and_lists_parents(tmp_path: Path) -> None:
    kit = made(tmp_path) / "kit"
    assert dict(paths_except(kit, kit / "a" / "labs")) == {
        kit: READ_DIR,
        kit / "a": READ_DIR,
        kit / "a" / "file": READ,
        kit / "b": READ,
    }
    assert dict(paths_except(kit, tmp_path / "elsewhere")) == {kit: READ}
    assert dict(paths_except(kit, kit)) == {}


@pytest.mark.slow
def test_kernel_opens_only_granted_paths(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT, str(made(tmp_path))], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    results = json.loads(done.stdout)
    if isinstance(results, str):
        pytest.skip(results)
    refused = dict.fromkeys(("labs", "beside", "write", "folder"), "PermissionError")
    assert results == {"kit": "done", "scratch": "done", **refused}
