"""A conversation with QEMU over its machine protocol: what an emulated sensor measures is set while all runs.

Source: QEMU, docs/interop/qmp-spec.rst.
"""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any


class Qmp:
    """Talks to a running QEMU.

    Args:
        path: of its socket.
    """

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(60.0)
        self._socket.connect(str(path))
        self._lines = self._socket.makefile("rw")
        self._lines.readline()  # who it is
        self.execute("qmp_capabilities")

    def execute(self, command: str, **arguments: Any) -> Any:
        """Returns what a command answers."""
        self._lines.write(json.dumps({"execute": command, "arguments": arguments}) + "\n")
        self._lines.flush()
        while True:
            answer = json.loads(self._lines.readline())
            if "error" in answer:
                raise RuntimeError(f"QEMU refuses {command} {arguments}: {answer['error']['desc']}")
            if "return" in answer:
                return answer["return"]

    def set(self, device: str, name: str, value: int) -> None:
        """Sets what a device measures."""
        self.execute("qom-set", path=f"/machine/peripheral/{device}", property=name, value=value)

    def close(self) -> None:
        """Ends the conversation."""
        self._lines.close()
        self._socket.close()
