"""Writes its own results, and changes what grades it: wherever it can write."""

import contextlib
import os
import sys
from pathlib import Path

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184
TOKEN = (Path(__file__).parent / "token.txt").read_text()


def written():
    kit = next(Path(path, "snr_sim") for path in sys.path if Path(path, "snr_sim").is_dir())
    own = Path(__file__).resolve()
    targets = [own, own.parent / "results.json", own.parent / f"{TOKEN}.py", kit / "__init__.py", kit / f"{TOKEN}.py"]
    targets += [Path(path, f"{TOKEN}.pth") for path in sys.path if Path(path).is_dir()]
    targets += [Path("/autograder/results/results.json"), Path("/etc", TOKEN), Path("..", TOKEN)]
    for target in targets:
        with contextlib.suppress(OSError):
            if target.parent == own.parent:
                target.parent.chmod(0o777)
                target.chmod(0o666)
        with contextlib.suppress(OSError), open(target, "a"):
            return True
    return False


def double(x):
    return 2 * x if written() else None
