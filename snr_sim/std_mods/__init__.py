"""Modules that any robot can use: filters, controllers, timers, a printer."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.prelude.attitude_filter import MahonyFilter as MahonyFilter
    from snr_sim.std_mods.allocation import Allocation as Allocation
    from snr_sim.std_mods.allocation import AllocationResult as AllocationResult
    from snr_sim.std_mods.complementary import ComplementaryFilter as ComplementaryFilter
    from snr_sim.std_mods.moving_average import MovingAvgFilter as MovingAvgFilter
    from snr_sim.std_mods.moving_average import MovingAvgFilterFactory as MovingAvgFilterFactory
    from snr_sim.std_mods.pid import Pid as Pid
    from snr_sim.std_mods.printer import PrinterEndpointFactory as PrinterEndpointFactory
    from snr_sim.std_mods.slew import SlewRateLimiter as SlewRateLimiter
    from snr_sim.std_mods.slew import approach as approach
    from snr_sim.std_mods.thrust_curve import ThrustCurve as ThrustCurve
    from snr_sim.std_mods.timing import StopwatchEndpointFactory as StopwatchEndpointFactory
    from snr_sim.std_mods.timing import TimeoutLoopFactory as TimeoutLoopFactory
    from snr_sim.std_mods.timing import Timer as Timer
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__, otherwise="snr_sim")
