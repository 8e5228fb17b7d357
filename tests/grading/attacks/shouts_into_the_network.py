"""Sends to any host: by address, by name, on this machine, over sockets without names."""

import contextlib
import importlib
from pathlib import Path

PORT = int((Path(__file__).parent / "port.txt").read_text())


def reached():
    socket = importlib.import_module("sock" + "et")
    for family, address in (
        (socket.AF_INET, ("127.0.0.1", PORT)),
        (socket.AF_INET6, ("::1", PORT)),
        (socket.AF_UNIX, f"\0snr_attack_{PORT}"),
    ):
        with contextlib.suppress(OSError):
            line = socket.socket(family, socket.SOCK_STREAM)
            line.settimeout(1)
            line.connect(address)
            line.sendall(b"the hidden cases are ...")
            return True
    return False


def double(x):
    return 2 * x if reached() else None
