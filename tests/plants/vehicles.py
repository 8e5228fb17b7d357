"""The vehicles of robots/urov, for tests of plants and of sensors on them."""

from pathlib import Path

from snr_sim.plants.urov.vehicle_file import read_vehicle

VEHICLES = Path(__file__).parents[2] / "robots" / "urov" / "vehicles"
HEAVY = read_vehicle(VEHICLES / "benzon2022.toml")
