"""A run in a notebook's page: the content of the frame, its server, and the message where there is no viewer."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from snr_sim.prelude.errors import TraceError
from snr_sim.view.view_notebook import RunFrame, show_run

VIEW = b"the content of a view.rrd"


@pytest.fixture
def rrd(tmp_path: Path) -> Path:
    path = tmp_path / "view.rrd"
    path.write_bytes(VIEW)
    return path


def page_of(frame: RunFrame) -> str:
    """Return the address that the frame loads, without what it asks the page to show."""
    html = frame._repr_html_()
    assert html is not None
    (address,) = re.findall(r'<iframe src="([^"?]+)\?', html)
    return str(address)


def read(address: str) -> tuple[bytes, dict[str, str]]:
    with urllib.request.urlopen(address, timeout=60) as answer:
        return answer.read(), dict(answer.headers)


@pytest.mark.slow
def test_frame_loads_viewer_from_loopback_only(rrd: Path) -> None:
    pytest.importorskip("rerun")
    page = page_of(show_run(rrd))
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", page)
    body, headers = read(page)
    assert b"canvas" in body
    rules = headers["Content-Security-Policy"].split()
    assert {rule for rule in rules if "://" in rule} == {"http://127.0.0.1:*"}


@pytest.mark.slow
def test_run_is_served_after_its_folder_is_deleted(rrd: Path) -> None:
    pytest.importorskip("rerun")
    page = page_of(show_run(rrd))
    rrd.unlink()
    assert read(page + "view.rrd")[0] == VIEW


@pytest.mark.slow
def test_frame_has_requested_height_and_text_alternative(rrd: Path) -> None:
    pytest.importorskip("rerun")
    frame = show_run(rrd, height_px=333)
    assert 'height="333"' in str(frame._repr_html_())
    assert repr(frame) == "The rerun viewer, on this computer, for as long as this notebook's kernel runs."


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks the kernel for a process's children")
def test_killed_notebook_leaves_no_viewer_process(rrd: Path) -> None:
    pytest.importorskip("rerun")
    code = f"from snr_sim.view.view_notebook import show_run; print(show_run({str(rrd)!r}).url, flush=True); input()"
    kernel = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        assert kernel.stdout is not None
        page = kernel.stdout.readline().split("?")[0]
        assert b"canvas" in read(page)[0]  # so the viewer has run, and its answer is here whole
        kernel_folder = Path(f"/proc/{kernel.pid}/task")
        assert [file.read_text() for file in kernel_folder.glob("*/children") if file.read_text()] == []
    finally:
        kernel.kill()
        kernel.communicate()
    with pytest.raises(urllib.error.URLError):
        read(page)


FORKS = """
import atexit, os, signal, sys
from snr_sim.view.view_notebook import show_run
print(show_run(sys.argv[1]).url, flush=True)
forked = os.fork()
if forked == 0:
    signal.alarm(20)
    atexit._run_exitfuncs()  # as a process of multiprocessing, which in Python 3.13 first forgets this one's
    os._exit(0)
print(os.waitpid(forked, 0)[1], flush=True)
input()
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
def test_process_forked_from_a_notebook_ends_and_leaves_the_page_served(rrd: Path) -> None:
    pytest.importorskip("rerun")
    kernel = subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", FORKS, rrd], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert kernel.stdout is not None
        page = kernel.stdout.readline().split("?")[0]
        assert kernel.stdout.readline() == "0\n"  # a signal would have ended it otherwise
        assert read(page + "view.rrd")[0] == rrd.read_bytes()
    finally:
        kernel.communicate("\n")


def test_missing_viewer_returns_install_command(rrd: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if "rerun" in name else find_spec(name))
    frame = show_run(rrd)
    assert (frame.url, frame._repr_html_()) == ("", None)
    assert re.fullmatch(r"Here the rerun viewer would show this run\. .*pip install 'snr_sim\[view\]'.*", repr(frame))
    assert show_run(rrd.parent / "what only a viewer could have written.rrd").url == ""


def test_missing_run_raises_with_its_name(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    with pytest.raises(TraceError, match="no run at"):
        show_run(tmp_path / "nothing")
