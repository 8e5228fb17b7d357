"""Parts any robot can use: filters, timers, printers, and the links between nodes.

`from snr_sim.std_mods import *`, as in programs for the thesis' library, is the same as `from snr_sim import *`.
"""

from typing import TYPE_CHECKING, Any

if not TYPE_CHECKING:  # type checkers read the modules themselves

    def __getattr__(name: str) -> Any:
        import snr_sim  # its lazy table knows the module of each public name

        return getattr(snr_sim, name)
