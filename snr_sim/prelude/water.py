"""Default water and air of pools and depth sensors: one module, so that both agree.

A pool converts depth to pressure, and a sensor pressure to depth; a sensor that assumes 997 kg/m3 and 9.80665 m/s2
in a pool of 1000 and 9.81 reads 0.34 % deep.
"""

from __future__ import annotations

FRESH_KGM3 = 1000.0  # rounded: at 18 degrees Celsius 998.6, at 25 degrees 997.0
GRAVITY_MPS2 = 9.81
AIR_PA = 101_325.0  # standard atmosphere, at the surface
