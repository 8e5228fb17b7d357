"""What a run was recorded with and what runs now: Python, packages, platform and snr_sim itself."""

from __future__ import annotations

import platform
from collections.abc import Mapping

from snr_sim.recording.records import Header


def environment_changes(header: Header, packages: Mapping[str, str], version: str) -> list[str]:
    """Return each difference between what a run was recorded with and this process, as text.

    Args:
        header: of the recorded run.
        packages: versions now, as in a header.
        kit: version of snr_sim now.
    """
    pairs = {
        "snr_sim": (header.version, version),
        "Python": (header.python, platform.python_version()),
        **{name: (header.packages.get(name), packages.get(name)) for name in sorted({*header.packages, *packages})},
        "platform": (header.platform, platform.platform()),
    }
    return [f"{name} {then or 'none'} then, {now or 'none'} now" for name, (then, now) in pairs.items() if then != now]
