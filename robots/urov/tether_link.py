"""The link through the tether, and its expected faults.

The vehicle's maker sends Ethernet over one twisted pair with a pair of powerline modems (HomePlug AV). On the pair they
reach 80 Mbit/s at best; over a tether of full length some tens are left, and a page takes some milliseconds.
"""

from __future__ import annotations

from snr_sim.errors import ParameterError
from snr_sim.links import LinkFaults

SIGNAL_MPS = 2.0e8  # two thirds of the speed of light, as in any cable
MODEM_S, MODEM_JITTER_S = 0.003, 0.002  # in each direction, through two modems: our estimate
FULL_BPS, FULL_M = 80e6, 300.0  # at the modem; and the length at which a tenth of it is left, our estimate


def tether_faults(
    length_m: float, loss: float = 0.0, cut: tuple[tuple[float, float], ...] = (), seed: int | None = None
) -> LinkFaults:
    """Return the faults of a link through a tether.

    >>> [round(tether_faults(length_m).bandwidth_bps) for length_m in (0.0, 300.0)]
    [80000000, 8000000]

    Args:
        length_m: of the tether.
        loss: fraction of pages that never arrive.
        cut: intervals (start_s, end_s) in which nothing arrives.
        seed: of its random numbers; the run's if None.

    Raises:
        ParameterError: the length, the loss or a cut is out of range.
    """
    if not 0.0 <= length_m <= FULL_M:
        raise ParameterError(f"The tether length must be in 0 to {FULL_M:g} m, not {length_m!r}.", fix="pass metres.")
    return LinkFaults(
        latency_s=MODEM_S + length_m / SIGNAL_MPS,
        jitter_s=MODEM_JITTER_S,
        loss=loss,
        cut=cut,
        bandwidth_bps=FULL_BPS * (1.0 - 0.9 * length_m / FULL_M),
        seed=seed,
    )
