"""The files of the live page: how large they are, what they may contain, and what the bundle is made of."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
STATIC = PROJECT / "snr_sim" / "web" / "static"
VENDOR = PROJECT / "snr_sim" / "web" / "vendor"
OWN = sorted(STATIC.glob("*.*"))
MAX_BUNDLE_BYTES = 500_000
MAX_BYTES = 600_000
MAX_LINES = 1225  # of code, without comments; 1200 before an edit could be tried and imported files were shown
WAYS_TO_HTML = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|DOMParser|srcdoc|\beval\(|new Function"


def test_static_folder_is_small() -> None:
    assert sum(path.stat().st_size for path in (STATIC / "lib").glob("*.js")) <= MAX_BUNDLE_BYTES
    assert sum(path.stat().st_size for path in STATIC.rglob("*.*")) <= MAX_BYTES


def test_own_scripts_stay_short() -> None:
    lines = [line.strip() for path in STATIC.glob("*.js") for line in path.read_text().splitlines()]
    assert len([line for line in lines if line and not re.match(r"//|/\*\*|\*", line)]) <= MAX_LINES


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
def test_own_file_makes_no_html_of_text_and_names_no_host(path: Path) -> None:
    text = path.read_text()
    assert not re.findall(WAYS_TO_HTML, text)
    assert set(re.findall(r"https?://[^\s\"'`/$]+", text)) <= {"http://www.w3.org"}  # the name space of drawings
    assert max(map(len, text.splitlines())) <= 180
    assert path.suffix != ".html" or not re.findall(r"<script>|\son\w+=|style=", text)


def test_ids_that_scripts_use_are_in_the_page() -> None:
    used = {name for path in STATIC.glob("*.js") for name in re.findall(r'part\("([\w-]+)"\)', path.read_text())}
    ids = re.findall(r'\bid="([\w-]+)"', (STATIC / "live.html").read_text())
    assert used <= set(ids)
    assert len(ids) == len(set(ids))


def test_bundle_is_of_exact_versions_with_licences() -> None:
    package = json.loads((VENDOR / "package.json").read_text())
    versions = package["dependencies"] | package["overrides"]
    assert all(re.fullmatch(r"\d+\.\d+\.\d+", one) for one in versions.values())
    found = re.findall(r"^(\S+) (\d\S+) \((.+)\)$", (STATIC / "lib" / "LICENSES.txt").read_text(), re.MULTILINE)
    assert len(found) >= 10
    assert {name: versions.get(name) for name, _, _ in found} == {name: version for name, version, _ in found}
    assert {licence for _, _, licence in found} <= {"MIT", "BSD-3-Clause", "ISC", "Apache-2.0"}


@pytest.mark.nightly
def test_bundle_is_what_its_build_makes(tmp_path: Path) -> None:
    if shutil.which("npm") is None:
        pytest.skip("There is no npm here to bundle with.")
    environment = {**os.environ, "npm_config_cache": str(tmp_path / "cache")}
    subprocess.run([VENDOR / "build", tmp_path / "lib"], check=True, env=environment)
    for name in ("editor.js", "dagre.js", "LICENSES.txt"):
        assert (tmp_path / "lib" / name).read_bytes() == (STATIC / "lib" / name).read_bytes(), f"run {VENDOR}/build"
