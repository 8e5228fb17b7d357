"""Takes heading's place, for passengers who are easily seasick: the same pages, and never more than 1 N m."""

from heading import Heading
from laws import limited

from snr_sim import EndpointFactory

MAX_NM = 1.0


def factories(robot):
    return [GentleFactory()]


class GentleFactory(EndpointFactory):
    def get(self, parent):
        return Gentle(self, parent, "heading")


class Gentle(Heading):
    def moment_nm(self, imu):
        return limited(super().moment_nm(imu), MAX_NM)
