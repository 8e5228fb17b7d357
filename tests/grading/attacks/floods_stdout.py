"""Prints without end."""

import os

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184


def double(x):
    while True:
        os.write(1, b"passed 100 of 100 points\n" * 4000)
        os.write(2, b"\x1b[2J\x1b]0;all points\x07" * 4000)
