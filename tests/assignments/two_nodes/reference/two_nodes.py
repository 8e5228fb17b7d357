"""Both ends of the tether: which component runs where. Do not change it.

surface (role "topside")                       vehicle (role "urov")
page "sticks" --> topside.py --> page "controls" ======> vehicle.py --> page "pwm" --> thrusters
page "alarm" <--- topside.py <====================== page "vehicle" <--'
"""

from topside import TopsideFactory
from vehicle import VehicleFactory

ROLES = ("urov", "topside")


def factories(robot):
    if robot.role == "topside":
        return [TopsideFactory()]
    return [VehicleFactory()]
