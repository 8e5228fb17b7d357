"""Closes every descriptor that it did not open."""

import os


def double(x):
    os.closerange(0, 4096)
    return 2 * x
