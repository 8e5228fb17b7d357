"""Readings of sensors and commands to actuators, as pages and devices carry them."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.prelude.ground_signals import ARM_JOINTS as ARM_JOINTS
    from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A as NEUTRAL_BRAKE_A
    from snr_sim.prelude.ground_signals import ArmCommand as ArmCommand
    from snr_sim.prelude.ground_signals import ArmReading as ArmReading
    from snr_sim.prelude.ground_signals import DriveCommand as DriveCommand
    from snr_sim.prelude.ground_signals import MotorReading as MotorReading
    from snr_sim.prelude.signals import CLAMPED as CLAMPED
    from snr_sim.prelude.signals import LOST as LOST
    from snr_sim.prelude.signals import NO_PULSE as NO_PULSE
    from snr_sim.prelude.signals import NOT_ACTIVE as NOT_ACTIVE
    from snr_sim.prelude.signals import RESET as RESET
    from snr_sim.prelude.signals import SLEWING as SLEWING
    from snr_sim.prelude.signals import STOPPED as STOPPED
    from snr_sim.prelude.signals import TOO_OLD as TOO_OLD
    from snr_sim.prelude.signals import WRONG_COUNT as WRONG_COUNT
    from snr_sim.prelude.signals import AppliedPulses as AppliedPulses
    from snr_sim.prelude.signals import Ball as Ball
    from snr_sim.prelude.signals import DepthReading as DepthReading
    from snr_sim.prelude.signals import DozerCommand as DozerCommand
    from snr_sim.prelude.signals import EchoReading as EchoReading
    from snr_sim.prelude.signals import EngineCommand as EngineCommand
    from snr_sim.prelude.signals import GamepadReading as GamepadReading
    from snr_sim.prelude.signals import GpsReading as GpsReading
    from snr_sim.prelude.signals import ImuReading as ImuReading
    from snr_sim.prelude.signals import InertialReading as InertialReading
    from snr_sim.prelude.signals import LeakReading as LeakReading
    from snr_sim.prelude.signals import MotorCommand as MotorCommand
    from snr_sim.prelude.signals import PoseReading as PoseReading
    from snr_sim.prelude.signals import PowerReading as PowerReading
    from snr_sim.prelude.signals import PwmCommand as PwmCommand
    from snr_sim.prelude.signals import RadarReading as RadarReading
    from snr_sim.prelude.signals import TouchReading as TouchReading
    from snr_sim.prelude.signals import ViewReading as ViewReading
    from snr_sim.prelude.signals import WheelReading as WheelReading
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
