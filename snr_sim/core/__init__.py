"""What runs: the event machine, its door, the components on it, the clocks and the runners.

`from snr_sim.core import *`, as the thesis' listings have it, gives what `from snr_sim import *` gives.
"""

from typing import TYPE_CHECKING, Any

if not TYPE_CHECKING:  # type checkers are told by each module itself

    def __getattr__(name: str) -> Any:
        import snr_sim  # the front door, which knows where each public name is

        return getattr(snr_sim, name)
