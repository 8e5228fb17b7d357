"""Both ends of the tether: which component runs where. Do not change it.

surface (role "topside")                       vehicle (role "urov")
page "sticks" --> topside.py --> page "controls" ======> vehicle.py --> page "pwm" --> thrusters
page "alarm" <--- topside.py <====================== page "vehicle" <--'
"""

from topside import Topside
from vehicle import Vehicle

ROLES = ("urov", "topside")


def factories(robot):
    if robot.role == "topside":
        return [Topside.factory()]
    return [Vehicle.factory()]
