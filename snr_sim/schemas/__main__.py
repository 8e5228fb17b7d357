"""`python -m snr_sim.schemas` prints the schemas' folder; with --write it regenerates those that come from code."""

from __future__ import annotations

import sys

from snr_sim.schemas import FOLDER, NAMES, SUFFIX

if "--write" in sys.argv:
    from snr_sim.schemas.generate import write

    write(FOLDER)
for name in NAMES:
    print(FOLDER / f"{name}{SUFFIX}")  # noqa: T201
