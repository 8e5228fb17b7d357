"""Says how large an environment's packages are, and fails above a limit: python install_size.py VENV LIMIT_MB."""

from __future__ import annotations

import sys
from pathlib import Path

# What every environment has before anything is installed into it.
BEFORE = ("pip", "setuptools", "wheel", "distutils-precedence", "_distutils_hack", "pkg_resources")


def size_mb(venv: Path) -> float:
    """Returns the size of all packages but pip's own, without bytecode, in MB (10^6 bytes)."""
    packages = next(venv.glob("lib/python*/site-packages"))
    files = (path for path in packages.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    ours = (path for path in files if not path.relative_to(packages).parts[0].startswith(BEFORE))
    return sum(path.stat().st_size for path in ours) / 1e6


if __name__ == "__main__":
    size, limit = size_mb(Path(sys.argv[1])), float(sys.argv[2])
    print(f"base install: {size:.1f} MB of at most {limit:.0f} MB")
    sys.exit(0 if size < limit else 1)
