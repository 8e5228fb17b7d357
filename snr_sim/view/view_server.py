"""Opens a view: in rerun's own window, or in the browser with a page that only this machine can reach.

rerun's command-line program displays the view. It is started with 127.0.0.1 as the address to listen on, because its
default is every network interface, and with usage statistics off. By default the page in the browser would request a
font and send statistics; therefore it is served with a content security policy, with which the browser itself blocks
every address but this machine's.
"""

from __future__ import annotations

import http.client
import importlib.util
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import IO
from urllib.parse import quote, urlsplit

from snr_sim.prelude.errors import MissingExtraError, SnrError, TraceError

LOOPBACK = "127.0.0.1"
START_DEADLINE_S = 20.0
# The address of the page must differ from the one of its data only in the port, so ports are open; hosts are not.
POLICY: str = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    f"img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' data: blob: http://{LOOPBACK}:*"
)
FILE_NAME = "view.rrd"
PROXIED_HEADERS = ("Content-Type", "rerun-final-length")
_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_MAX_CHARS = 300


def open_view(path: str | Path, web: bool = False) -> None:
    """Show a view.rrd in a window, or in the browser; return when its window is closed or on Ctrl-C.

    Raises:
        MissingExtraError: rerun is not installed.
        TraceError: there is no such file, or the viewer does not start or fails.
    """
    path = Path(path)
    if not path.is_file():
        raise TraceError(f"There is no view at {path}.", fix="snr view RUN makes one of a run.")
    if not web:
        check_display("snr view", "snr view RUN --web")
        with tempfile.TemporaryFile() as error_output:
            _wait_for(_window([str(path)], error_output), error_output)
        return
    with suppress(KeyboardInterrupt), serve_web(path) as url:
        print(f"Open {url}\nOnly this computer can reach it. Ctrl-C ends it.", flush=True)
        while True:
            time.sleep(3600)


@contextmanager
def live_window(url: str, print_line: Callable[[str], None]) -> Iterator[None]:
    """Show a `LiveView` in rerun's own window, which stays open; print at the end of the block if it has failed."""
    with tempfile.TemporaryFile() as error_output:
        process = _window(["--connect", url], error_output)
        yield
        if process.poll():
            error = _failure(process.returncode, error_output, "snr run ... --web-view")
            print_line(f"{error.message} {error.fix}")


def check_display(asked: str, instead: str) -> None:
    """Check that there is a display for the window that `asked` opens; `instead` shows the same in a browser."""
    if sys.platform == "linux" and not any(os.environ.get(name) for name in _DISPLAYS):
        raise TraceError(
            f"{asked} opens a window, and there is no display: neither {' nor '.join(_DISPLAYS)} is set.",
            fix=f"{instead} shows it in a browser.",
        )


def _window(what: list[str], error_output: IO[bytes]) -> subprocess.Popen[bytes]:
    command = [*viewer_command(), "--bind", LOOPBACK, "--port", "auto", *what]
    return subprocess.Popen(command, env=viewer_environment(), stderr=error_output)


@contextmanager
def serve_web(source: str | Path | bytes, keeps_viewer: bool = True) -> Iterator[str]:
    """Serve the viewer's page while the block runs; yield its address.

    Args:
        source: path or content of a view.rrd, or the url of a `LiveView`.
        keeps_viewer: whether rerun's server of the page runs during the whole block. Otherwise it runs only during
            requests, which is slightly slower, but does not leave a process behind when this one is killed.
    """
    with _web_viewer() if keeps_viewer else nullcontext(0) as viewer_port:
        handler = type("Handler", (_PageHandler,), {"viewer_port": viewer_port, "source": source})
        server = ThreadingHTTPServer((LOOPBACK, 0), handler)
        server.daemon_threads = True
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        page = f"http://{LOOPBACK}:{server.server_address[1]}"
        data = source if isinstance(source, str) and "://" in source else f"{page}/{FILE_NAME}"
        try:
            yield f"{page}/?url={quote(str(data), safe='')}&hide_welcome_screen=1"
        finally:
            if thread.is_alive():  # it is not in a process forked from this one, where `shutdown` would never return
                server.shutdown()
                thread.join()
            server.server_close()


class _PageHandler(BaseHTTPRequestHandler):
    """Handler that serves the view, and forwards the rest of the page from rerun's own server with the policy."""

    viewer_port = 0
    source: str | Path | bytes = b""

    def do_GET(self) -> None:
        """Answer one request."""
        try:
            if urlsplit(self.path).path == f"/{FILE_NAME}":
                self._serve_file()
            else:
                self._proxy()
        except (BrokenPipeError, ConnectionResetError):
            pass  # the page was closed or loaded again

    def _serve_file(self) -> None:
        try:
            content = self.source if isinstance(self.source, bytes) else Path(self.source).read_bytes()
        except OSError as error:
            self.send_error(404, str(error))
            return
        self._answer(200, {"Content-Type": "application/octet-stream"}, content)

    def _proxy(self) -> None:
        try:
            with nullcontext(self.viewer_port) if self.viewer_port else _web_viewer() as port:
                answer, body = self._ask(port)
        except (OSError, SnrError) as error:
            self.send_error(502, f"the viewer does not answer: {error}")
            return
        headers = {name: value for name in PROXIED_HEADERS if (value := answer.getheader(name))}
        self._answer(answer.status, {**headers, "Content-Security-Policy": POLICY}, body)

    def _answer(self, status: int, headers: dict[str, str], body: bytes) -> None:
        self.send_response(status)
        for name, value in {**headers, "Content-Length": str(len(body))}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def _ask(self, port: int) -> tuple[http.client.HTTPResponse, bytes]:
        with closing(http.client.HTTPConnection(LOOPBACK, port, timeout=START_DEADLINE_S)) as viewer:
            viewer.request("GET", self.path)
            answer = viewer.getresponse()
            return answer, answer.read()

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 (the name of the overridden method)
        """Log nothing: each of the page's requests would print a line in the student's terminal."""


@contextmanager
def _web_viewer() -> Iterator[int]:
    """Run rerun's server of the viewer's page, and yield its port.

    It is started without a file, because with one it keeps a core busy while it runs (0.41).
    """
    port = free_port()
    command = [*viewer_command(), "--serve-web", "--bind", LOOPBACK, "--web-viewer-port", str(port)]
    command += ["--port", str(free_port())]
    process = subprocess.Popen(command, env=viewer_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        _wait_until_it_answers(process, port)
        yield port
    finally:
        process.terminate()
        try:
            process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _wait_until_it_answers(process: subprocess.Popen[bytes], port: int) -> None:
    deadline_s = time.monotonic() + START_DEADLINE_S
    while time.monotonic() < deadline_s and process.poll() is None:
        with socket.socket() as probe:
            probe.settimeout(0.2)
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(0.02)
    raise TraceError(
        "The rerun viewer did not start.",
        fix="run 'rerun --version'; if that fails too, reinstall it: pip install --force-reinstall rerun-sdk",
    )


def free_port() -> int:
    """Return a free TCP port."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def viewer_command() -> list[str]:
    """Return the command of the viewer.

    It is the program itself if it is found: `python -m rerun_cli` only starts it, and leaves it running when ended.

    Raises:
        MissingExtraError: rerun is not installed.
    """
    found = importlib.util.find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise MissingExtraError("rerun-sdk", "view")
    program = Path(found.origin).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
    return [str(program)] if program.is_file() else [sys.executable, "-m", "rerun_cli"]


def viewer_environment() -> dict[str, str]:
    """Return the environment in which rerun neither sends statistics nor writes an identity for them (0.41).

    Its log has errors only. With the variable CI, rerun disables its statistics. `rerun analytics disable` would do
    that, too, but for all of the student's use of rerun, which is the student's decision.
    """
    kept = {name: value for name, value in os.environ.items() if name != "FORCE_RERUN_ANALYTICS"}
    return {"RUST_LOG": "error", **kept, "CI": "1"}


def _wait_for(process: subprocess.Popen[bytes], error_output: IO[bytes]) -> None:
    try:
        status = process.wait()
    except KeyboardInterrupt:
        process.terminate()
        status = process.wait() and 0
    if status:
        raise _failure(status, error_output, "snr view RUN --web")


def _failure(status: int, error_output: IO[bytes], instead: str) -> TraceError:
    """Return the error of a failed viewer, with the last line that it printed."""
    error_output.seek(0)
    lines = _COLOURS.sub("", error_output.read().decode(errors="replace")).split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), "nothing")
    return TraceError(
        f"The viewer ended with status {status}; its last words: {last[:_MAX_CHARS]}",
        fix=f"without a screen or a graphics driver of its own, show it in a browser: {instead}",
    )
