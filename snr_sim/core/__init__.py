"""Runtime: the event machine, its inbox, components, clocks and runners.

`from snr_sim.core import *`, as the thesis' listings have it, gives what `from snr_sim import *` gives.
"""

from typing import TYPE_CHECKING, Any

if not TYPE_CHECKING:  # type checkers read each module itself

    def __getattr__(name: str) -> Any:
        import snr_sim  # has the table of public names and their modules

        return getattr(snr_sim, name)
