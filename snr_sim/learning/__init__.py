"""Scenarios as gymnasium environments. Importing this makes them known to gymnasium."""

from snr_sim.learning.gym import make_known

make_known()
