"""Runs drivers over a real smbus2, with an emulated /dev/i2c-1; prints their readings as JSON."""

import json
import time

from snr_sim.devices.pwm.passive_pwm import PassivePwm
from snr_sim.devices.pwm.pca9685 import Pca9685
from snr_sim.devices.sensors.ms5837_i2c import Ms5837I2c
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.prelude.errors import DeviceError


def main() -> None:
    out = PassivePwm(Pca9685(lambda: I2cBus(1), 0x40, 8), time.monotonic, esc_start_s=0.0, is_supervised=True)
    out.configure()
    out.activate()
    out.write_us([1500.0] * 8, time.monotonic())
    applied = out.write_us([1700.0] * 8, time.monotonic())
    sensor = Ms5837I2c(lambda: I2cBus(1), time.monotonic)
    sensor.configure()
    sensor.activate()
    reading = sensor.read()
    try:
        I2cBus(1).read(0x41, 0, 1)
    except DeviceError as error:
        missing = error.message
    print(json.dumps([applied.pulses_us, applied.reason, reading.pressure_pa, reading.temperature_c, missing]))


if __name__ == "__main__":
    main()
