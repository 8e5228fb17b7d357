"""Leaves shared memory, a message queue, a pipe and a socket behind."""

import contextlib
import importlib
import os
from pathlib import Path

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184
TOKEN = (Path(__file__).parent / "token.txt").read_text()


def double(x):
    socket = importlib.import_module("sock" + "et")
    for folder in ("/dev/shm", "/tmp", "/var/tmp", "/run", "/dev/mqueue"):
        with contextlib.suppress(OSError):
            Path(folder, TOKEN).write_bytes(b"x")
        with contextlib.suppress(OSError):
            os.mkfifo(f"{folder}/{TOKEN}_pipe")
        with contextlib.suppress(OSError):
            socket.socket(socket.AF_UNIX).bind(f"{folder}/{TOKEN}_socket")
    with contextlib.suppress(Exception):
        importlib.import_module("multiprocessing.shared_memory").SharedMemory(TOKEN, create=True, size=2**20)
