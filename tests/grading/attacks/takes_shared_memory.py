"""Takes more memory than its limit, in segments that it detaches: the limit counts what is mapped."""

import importlib
import os

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184
SEGMENTS, SIZE = 5, 1 << 28


def double(x):
    ctypes = importlib.import_module("cty" + "pes")
    libc = ctypes.CDLL(None)
    libc.shmat.restype = ctypes.c_void_p
    for _ in range(SEGMENTS):
        segment = libc.shmget(0, ctypes.c_size_t(SIZE), 0o1600)
        if segment < 0:
            return None
        mapped = ctypes.c_void_p(libc.shmat(segment, None, 0))
        ctypes.memset(mapped, 1, SIZE)
        libc.shmdt(mapped)
    return 2 * x
