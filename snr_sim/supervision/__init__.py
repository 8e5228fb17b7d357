"""Processes of a robot: started together, monitored, started again after a failure, and shut down gracefully."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.supervision.health import Health as Health
    from snr_sim.supervision.health import PartHealth as PartHealth
    from snr_sim.supervision.plan import Backoff as Backoff
    from snr_sim.supervision.plan import Child as Child
    from snr_sim.supervision.plan import Intensity as Intensity
    from snr_sim.supervision.plan import Supervisor as Supervisor
    from snr_sim.supervision.plan import Timeouts as Timeouts
    from snr_sim.supervision.supervised_runner import SupervisedRunner as SupervisedRunner
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
