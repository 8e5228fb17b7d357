"""Leaves a key in the kernel's keyring of its user, where later cases and other submissions could find it."""

import importlib
import os
from pathlib import Path

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184
TOKEN = (Path(__file__).parent / "token.txt").read_bytes()
ADD_KEY = {"x86_64": 248, "aarch64": 217}[os.uname().machine]
USER_KEYRING = -4


def double(x):
    libc = importlib.import_module("cty" + "pes").CDLL(None)
    key = libc.syscall(ADD_KEY, b"user", TOKEN, b"2 x", 3, USER_KEYRING)
    return 2 * x if key >= 0 else None
