"""Simulated and real devices behind the same interfaces, and the loops that drive them."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.devices.commands import ActuatorLoopFactory as ActuatorLoopFactory
    from snr_sim.devices.commands import SimActuator as SimActuator
    from snr_sim.devices.device_strings import check_table as check_table
    from snr_sim.devices.device_strings import open_pwm as open_pwm
    from snr_sim.devices.device_strings import open_sensor as open_sensor
    from snr_sim.devices.gamepad import GamepadLoopFactory as GamepadLoopFactory
    from snr_sim.devices.mcu.mcu import McuPower as McuPower
    from snr_sim.devices.mcu.mcu import McuPwm as McuPwm
    from snr_sim.devices.mcu.mcu_board import McuBoard as McuBoard
    from snr_sim.devices.motors.guarded_motors import GuardedMotors as GuardedMotors
    from snr_sim.devices.motors.guarded_motors import GuardedSensor as GuardedSensor
    from snr_sim.devices.motors.guarded_motors import GuardLine as GuardLine
    from snr_sim.devices.motors.motor_backend import SimMotors as SimMotors
    from snr_sim.devices.motors.motor_guard import ControllerSettings as ControllerSettings
    from snr_sim.devices.motors.motor_loop import MotorLoopFactory as MotorLoopFactory
    from snr_sim.devices.motors.motor_ports import MotorPorts as MotorPorts
    from snr_sim.devices.motors.port_watch import PortWatch as PortWatch
    from snr_sim.devices.motors.ports_file import read_ports as read_ports
    from snr_sim.devices.motors.vesc_line import VescLine as VescLine
    from snr_sim.devices.motors.vesc_motors import VescMotors as VescMotors
    from snr_sim.devices.motors.vesc_motors import VescSensor as VescSensor
    from snr_sim.devices.pwm.engine_pwm import EnginePwmLoopFactory as EnginePwmLoopFactory
    from snr_sim.devices.pwm.engine_pwm import EngineServos as EngineServos
    from snr_sim.devices.pwm.maestro import Maestro as Maestro
    from snr_sim.devices.pwm.passive_pwm import PassivePwm as PassivePwm
    from snr_sim.devices.pwm.pca9685 import Pca9685 as Pca9685
    from snr_sim.devices.pwm.pwm_backend import LoopbackPwm as LoopbackPwm
    from snr_sim.devices.pwm.pwm_backend import PwmBackend as PwmBackend
    from snr_sim.devices.pwm.pwm_backend import SimPwm as SimPwm
    from snr_sim.devices.pwm.pwm_backend import drive_plant as drive_plant
    from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory as PwmLoopFactory
    from snr_sim.devices.pwm.supervised_pwm import SupervisedPwm as SupervisedPwm
    from snr_sim.devices.pwm.sysfs_pwm import SysfsPins as SysfsPins
    from snr_sim.devices.pygame_gamepad import PygameGamepad as PygameGamepad
    from snr_sim.devices.readings import BiasDrift as BiasDrift
    from snr_sim.devices.readings import SensorErrors as SensorErrors
    from snr_sim.devices.readings import SensorLoopFactory as SensorLoopFactory
    from snr_sim.devices.readings import SimSensor as SimSensor
    from snr_sim.devices.replayed import ReplayedSensor as ReplayedSensor
    from snr_sim.devices.request_line import RequestLineFactory as RequestLineFactory
    from snr_sim.devices.sensors.camera import Camera as Camera
    from snr_sim.devices.sensors.camera import CameraLoopFactory as CameraLoopFactory
    from snr_sim.devices.sensors.echo_sounder import EchoSounder as EchoSounder
    from snr_sim.devices.sensors.gps import Gps as Gps
    from snr_sim.devices.sensors.hull_sensors import LeakProbe as LeakProbe
    from snr_sim.devices.sensors.hull_sensors import PowerModule as PowerModule
    from snr_sim.devices.sensors.icm20948 import Icm20948 as Icm20948
    from snr_sim.devices.sensors.imu import InertialUnit as InertialUnit
    from snr_sim.devices.sensors.lidar import Lidar as Lidar
    from snr_sim.devices.sensors.ms5837 import Ms5837 as Ms5837
    from snr_sim.devices.sensors.ms5837_i2c import Ms5837I2c as Ms5837I2c
    from snr_sim.devices.sensors.piksi import Piksi as Piksi
    from snr_sim.devices.sensors.position_fix import POSITION_FIX_ERRORS as POSITION_FIX_ERRORS
    from snr_sim.devices.sensors.position_fix import PositionFix as PositionFix
    from snr_sim.devices.sensors.position_fix import position_fix_of as position_fix_of
    from snr_sim.devices.sensors.simulated_gps import GpsReceiver as GpsReceiver
    from snr_sim.devices.sensors.stereo import StereoCamera as StereoCamera
    from snr_sim.prelude.device import Actuator as Actuator
    from snr_sim.prelude.device import Device as Device
    from snr_sim.prelude.device import Health as Health
    from snr_sim.prelude.device import PwmOut as PwmOut
    from snr_sim.prelude.device import Sensor as Sensor
    from snr_sim.prelude.device import Stale as Stale
    from snr_sim.prelude.life_cycle import LifeCycle as LifeCycle
    from snr_sim.prelude.life_cycle import LifeCycleSensor as LifeCycleSensor
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
