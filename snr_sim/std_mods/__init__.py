"""Parts any robot can use: filters, timers, printers, and the links between nodes.

`from snr_sim.std_mods import *`, as programs of the thesis' time have it, gives what `from snr_sim import *` gives.
"""

from typing import TYPE_CHECKING, Any

if not TYPE_CHECKING:  # type checkers read the modules themselves

    def __getattr__(name: str) -> Any:
        import snr_sim  # its lazy table knows the module of each public name

        return getattr(snr_sim, name)
