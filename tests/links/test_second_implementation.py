"""A program with the standard library only, written from docs/formats.md, exchanges pages with a node over TCP."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from snr_sim import SocketsPair
from snr_sim.links.frames import MAC_BYTES, FrameMac, encode_frame
from snr_sim.links.security import derive_key

ROOT = Path(__file__).parents[2]
CLIENT = ROOT / "tests" / "second_implementation" / "plain_client.py"
HERE = "127.0.0.1"
SECRET = "correct horse battery staple"
UNUSUAL = (1, {2: (2.5,)})

Call = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def call() -> Iterator[Call]:
    """Start the plain client: `call(port, secret, pages)`; it sends a page `joystick`, {"axis": 0.5}."""
    called: list[subprocess.Popen[str]] = []

    def begin(port: int, secret: str, pages: int) -> subprocess.Popen[str]:
        words = ["link", HERE, str(port), secret, str(pages), "joystick", '{"axis": 0.5}']
        command = [sys.executable, "-I", "-S", CLIENT, *words]
        called.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
        return called[-1]

    yield begin
    for client in called:
        client.kill()
        client.communicate()


def serve(start: Callable[..., Any], secret: str | None) -> tuple[Any, int]:
    pair = SocketsPair((HERE, 0), name="tether", secret=secret, keep_alive_s=0.05)
    node = start("rov", [pair.server("depth")], down="tether")
    return node, pair.port


@pytest.mark.slow
@pytest.mark.parametrize("secret", [None, SECRET])
def test_second_implementation_sends_and_receives_pages_and_pings(
    start: Callable[..., Any], call: Call, secret: str | None
) -> None:
    node, port = serve(start, secret)
    client = call(port, secret or "", 2)
    assert node.until_stored("joystick") == [{"axis": 0.5}]
    node.store("depth", UNUSUAL)
    node.until(lambda: node.stored["link_tether"][-1]["rtt_s"] is not None, "an answer to a ping")
    assert list(node.stored["link_tether"][-1]["peers"]) == ["plain_node"]
    node.store("depth", 1.5)
    out, err = client.communicate(timeout=120)
    assert (client.returncode, err) == (0, "")
    assert out.splitlines() == [
        "up rov_node",
        f"page depth rov_node {UNUSUAL!r}",
        "page depth rov_node 1.5",
        "page ",
    ]
    assert "'plain_node' left: that was all." in node.until_link("tether", up=False)["reason"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ours", "theirs", "expected"),
    [
        (
            SECRET,
            SECRET + "r",
            "refused the shared secrets of the two ends differ, "
            "or a third party forwarded or changed a greeting. Try: ",
        ),
        (SECRET, "", "refused node 'rov_node' asks for a shared secret"),
        (None, SECRET, "refused node 'plain_node' asks for a shared secret"),
    ],
)
def test_refused_client_receives_the_reason(
    start: Callable[..., Any], call: Call, ours: str | None, theirs: str, expected: str
) -> None:
    node, port = serve(start, ours)
    out, _ = call(port, theirs, 1).communicate(timeout=120)
    assert expected in out
    assert not node.stored["joystick"]


@pytest.mark.slow
def test_client_receives_the_goodbye_of_the_node(start: Callable[..., Any], call: Call) -> None:
    node, port = serve(start, None)
    client = call(port, "", 1)
    node.until_stored("joystick")
    node.end()
    assert client.communicate(timeout=120)[0].splitlines()[-1] == "bye node 'rov_node' ended: test is over."


def test_proofs_and_mac_of_the_example_equal_the_documented_ones() -> None:
    text = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    hellos = [encode_frame(line.strip().encode()) for line in text.splitlines() if '"auth":true' in line]
    keys = {
        f"{side} {use}": derive_key(SECRET.encode(), f"{side} {use}", *hellos)
        for use in ("proof", "frames")
        for side in ("client", "server")
    }
    shown = [line.split(":") for line in text.splitlines() if line.startswith(("    client ", "    server "))]
    assert {use.strip(): value.strip() for use, value in shown} == {use: key.hex() for use, key in keys.items()}
    message = '{"$":"bye","reason":"done."}'
    mac = FrameMac(keys["client frames"]).seal(encode_frame(message.encode()))[-MAC_BYTES:]
    assert f"`{message}`, has the MAC `{mac.hex()}`" in text
