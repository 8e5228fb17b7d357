"""The parts of the lander in LRP programs."""

from snr_sim.behaviors import Bridge, Drive, Read

BRIDGE = Bridge(
    reads={
        "altitude_m": Read("radar", "altitude_m", unit="m", fresh_s=0.5, low=0.0, high=2000.0),
        "velocity_mps": Read("radar", "velocity_mps", unit="m/s, up positive", fresh_s=0.5, low=-200.0, high=200.0),
    },
    # The engine takes a command for a limited time.
    drives={"throttle": Drive("engine", "throttle", low=0.0, high=1.0, unit="share of full thrust", repeat_s=0.2)},
)
