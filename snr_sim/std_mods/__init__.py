"""Parts any robot can use: filters, timers, printers, and the links between nodes.

`from snr_sim.std_mods import *`, as programs of the thesis' time have it, gives what `from snr_sim import *` gives.
"""

from typing import TYPE_CHECKING, Any

if not TYPE_CHECKING:  # type checkers are told by each module itself

    def __getattr__(name: str) -> Any:
        import snr_sim  # the front door, which knows where each public name is

        return getattr(snr_sim, name)
