"""Common start of programs that examine their confinement, prepended to each as text."""

GUARD = """
import os
# Outside of an isolation this would harm the computer: it acts only as a user who owns nothing.
assert os.getuid() >= 61184, "not isolated"
"""
TRIES = (
    GUARD
    + '''
import errno, resource, sys

LIMITS = ("NPROC", "CORE", "FSIZE", "CPU", "AS", "NOFILE")


def tried(what, *args, **options):
    """Return the result of a call: "done", or the error's name."""
    try:
        what(*args, **options)
    except OSError as error:
        return errno.errorcode[error.errno]
    except Exception as error:
        return type(error).__name__
    return "done"


def write(path, size=1000):
    with open(path, "wb") as file:
        for _ in range(0, size, 1 << 20):
            file.write(bytes(min(size, 1 << 20)))


def looks(paths):
    return [tried(os.listdir if path.endswith("/") else open, path) for path in paths]


def limits():
    return [resource.getrlimit(getattr(resource, "RLIMIT_" + name)) for name in LIMITS]
'''
)
