"""Check with pyright that the types of all public symbols are known, and the course's programs as an editor does.

    python -m venv types && types/bin/pip install basedpyright '.[all]' && types/bin/python tests/public_types.py

The programs are the labs' starters, the templates of controllers and README's; they have no annotations, so the mode is
'basic'. Exit status: 0 all is known and no program has an error; 1 otherwise.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
MIN_KNOWN = 0.98
PACKAGE = "snr_sim"
COURSE = f"{PACKAGE}.shipped."  # robots, scenarios and starters as the wheel has them: not the library's interface


def run_pyright(folder: Path, *options: str) -> dict[str, Any]:
    """Return what pyright reports of a folder as JSON."""
    program = Path(sys.executable).with_name("basedpyright")
    environment = {**os.environ, "VIRTUAL_ENV": sys.prefix, "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}
    command = [str(program), "--outputjson", *options]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def unknown_symbols(folder: Path) -> tuple[list[str], int]:
    """Return the public symbols whose type is not wholly known, and the number of all."""
    report = run_pyright(folder, "--verifytypes", PACKAGE, "--ignoreexternal")["typeCompleteness"]
    symbols = [one for one in report["symbols"] if one["isExported"] and not one["name"].startswith(COURSE)]
    return [one["name"] for one in symbols if not one["isTypeKnown"]], len(symbols)


def write_programs(folder: Path) -> None:
    """Copy the programs, each lab into a folder of its own, and links to robots by the names of their packages."""
    robots = folder / "robots"
    robots.mkdir()
    for robot in (ROOT / "robots").iterdir():
        if robot.is_dir():
            (robots / f"snr_sim_robot_{robot.name}").symlink_to(robot)
            for template in robot.glob("*_template.py"):
                shutil.copy(template, folder / f"{robot.name}_{template.name}")
    for lab in (ROOT / "assignments").glob("*/starter"):
        shutil.copytree(lab, folder / lab.parent.name)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    (folder / "gentle.py").write_text(blocks[0])
    for i, block in enumerate(blocks[1:]):
        (folder / f"readme_{i}.py").write_text(block)
    options = {"typeCheckingMode": "basic", "ignore": ["robots"], "extraPaths": ["robots"]}
    (folder / "pyrightconfig.json").write_text(json.dumps(options))


def main() -> int:
    """Run both checks; return the exit status."""
    found = importlib.util.find_spec(PACKAGE)
    if found is None or found.origin is None or Path(found.origin).is_relative_to(ROOT):
        print(f"{PACKAGE} must be installed, and not as editable: pyright sees no other.")
        return 1
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        unknown, count = unknown_symbols(folder)
        write_programs(folder)
        errors = [one for one in run_pyright(folder)["generalDiagnostics"] if one["severity"] == "error"]
    print(f"{count - len(unknown)} of {count} public symbols have a known type.", *unknown[:50], sep="\n  ")
    print(f"{len(errors)} errors in programs.")
    for error in errors:
        name = os.path.relpath(error["file"], made)
        print(f"  {name}:{error['range']['start']['line'] + 1}: {error['message'].splitlines()[0]}")
    return 1 if not count or len(unknown) > (1.0 - MIN_KNOWN) * count or errors else 0


if __name__ == "__main__":
    sys.exit(main())
