"""Data types and interfaces that all other packages of `snr_sim` share.

`from snr_sim.prelude import *`, as in the thesis' listings, imports the same names as `from snr_sim import *`.
"""

from typing import TYPE_CHECKING, Any

if not TYPE_CHECKING:  # type checkers read each module directly

    def __getattr__(name: str) -> Any:
        import snr_sim  # the public package, which maps each public name to its module

        return getattr(snr_sim, name)
