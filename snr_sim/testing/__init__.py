"""Test tools: expectors, replayers, fakes and contracts. Students test their robots with them; time is virtual."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.testing.case import SNRTestCase as SNRTestCase
    from snr_sim.testing.contracts import check_actuator as check_actuator
    from snr_sim.testing.contracts import check_plant as check_plant
    from snr_sim.testing.contracts import check_sensor as check_sensor
    from snr_sim.testing.expector import Expectations as Expectations
    from snr_sim.testing.expector import Expector as Expector
    from snr_sim.testing.expector import ExpectorEndpointFactory as ExpectorEndpointFactory
    from snr_sim.testing.expector import OrderedExpector as OrderedExpector
    from snr_sim.testing.expector import TaskExpectations as TaskExpectations
    from snr_sim.testing.fake_i2c import FakeBus as FakeBus
    from snr_sim.testing.fake_i2c import FakePca9685 as FakePca9685
    from snr_sim.testing.fake_i2c import I2cDevice as I2cDevice
    from snr_sim.testing.fake_icm20948 import FakeIcm20948 as FakeIcm20948
    from snr_sim.testing.fake_maestro import FakeMaestro as FakeMaestro
    from snr_sim.testing.fake_mcu import FakeMcu as FakeMcu
    from snr_sim.testing.fake_ms5837 import FakeMs5837 as FakeMs5837
    from snr_sim.testing.fake_recorder import FakeRecorder as FakeRecorder
    from snr_sim.testing.fake_sysfs_pwm import FakeSysfsPwm as FakeSysfsPwm
    from snr_sim.testing.fakes import FakeActuator as FakeActuator
    from snr_sim.testing.fakes import FakePlant as FakePlant
    from snr_sim.testing.fakes import FakeSensor as FakeSensor
    from snr_sim.testing.function_components import FunctionEndpointFactory as FunctionEndpointFactory
    from snr_sim.testing.function_components import FunctionLoopFactory as FunctionLoopFactory
    from snr_sim.testing.machines import MachineStory as MachineStory
    from snr_sim.testing.machines import StoryChoices as StoryChoices
    from snr_sim.testing.machines import random_stories as random_stories
    from snr_sim.testing.motor_contract import MotorBench as MotorBench
    from snr_sim.testing.motor_contract import check_motors as check_motors
    from snr_sim.testing.pwm_contract import PwmBench as PwmBench
    from snr_sim.testing.pwm_contract import check_pwm_out as check_pwm_out
    from snr_sim.testing.virtual_gamepad import VirtualGamepad as VirtualGamepad
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
