"""Errors that this library raises on purpose. Each has the cause, and one fix to try."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.prelude.errors import ClockError as ClockError
    from snr_sim.prelude.errors import CommandError as CommandError
    from snr_sim.prelude.errors import ComponentFailedError as ComponentFailedError
    from snr_sim.prelude.errors import ConfigError as ConfigError
    from snr_sim.prelude.errors import DeviceError as DeviceError
    from snr_sim.prelude.errors import FrameTooLargeError as FrameTooLargeError
    from snr_sim.prelude.errors import LinkError as LinkError
    from snr_sim.prelude.errors import MissingExtraError as MissingExtraError
    from snr_sim.prelude.errors import ParameterError as ParameterError
    from snr_sim.prelude.errors import PlantError as PlantError
    from snr_sim.prelude.errors import RecordingError as RecordingError
    from snr_sim.prelude.errors import RetiredNameError as RetiredNameError
    from snr_sim.prelude.errors import SensorLostError as SensorLostError
    from snr_sim.prelude.errors import SnrError as SnrError
    from snr_sim.prelude.errors import SupervisionError as SupervisionError
    from snr_sim.prelude.errors import TaskError as TaskError
    from snr_sim.prelude.errors import TraceError as TraceError
    from snr_sim.prelude.errors import UnknownNameError as UnknownNameError
    from snr_sim.prelude.errors import ValueEncodingError as ValueEncodingError
    from snr_sim.prelude.errors import suggest as suggest
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
