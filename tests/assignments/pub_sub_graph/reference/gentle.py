"""Takes heading's place, for passengers who are easily seasick: the same pages, and never more than 1 N m."""

from heading import Heading
from laws import limited

MAX_NM = 1.0


class Gentle(Heading):
    def moment_nm(self, imu):
        return limited(super().moment_nm(imu), MAX_NM)


def factories(robot):
    return [Gentle.factory("heading")]
