"""`snr new service NAME`: a unit file of systemd that runs the processes in NAME.py from the start of the computer."""

from __future__ import annotations

import sys
from pathlib import Path

from snr_sim.cli.output import print_text
from snr_sim.prelude.errors import ParameterError

# Type=notify and WatchdogSec: `supervision/systemd.py`. KillMode=mixed: the supervisor alone is asked, ends the others
# in order, and what is left is killed.
_UNIT = """\
[Unit]
Description=Robot {name}
StartLimitIntervalSec=300
StartLimitBurst=5

[Service]
Type=notify
WorkingDirectory={folder}
ExecStart="{python}" -m snr_sim processes "{file}"
Restart=on-failure
RestartSec=1
WatchdogSec=30
TimeoutStartSec=60
TimeoutStopSec=15
KillMode=mixed

[Install]
WantedBy=multi-user.target
"""


def begin_service(name: str, target: Path) -> None:
    """Write the unit file.

    Raises:
        ParameterError: there is no file of that name, or a path has characters that a unit file does not take.
    """
    file = Path(f"{name}.py").resolve()
    if not file.is_file():
        raise ParameterError(f"There is no {name}.py here.", fix="a file of RoverProcesses, as for snr processes.")
    for path in (str(file), sys.executable):
        if not path.isprintable() or set(path) & set('%"\\$'):
            raise ParameterError(f"A unit file cannot have the path {path!r}.", fix='a path without %, $, " and \\.')
    unit = _UNIT.format(name=name, folder=file.parent, python=sys.executable, file=file)
    target.write_text(unit, encoding="utf-8")
    print_text(f"{target} starts {name}.py with the computer. Put it into /etc/systemd/system, then:")
    print_text(f"sudo systemctl enable --now {target}; journalctl -u {target}")
