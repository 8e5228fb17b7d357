"""Pickled arguments of a student's `factories`. The grader writes them, so the student's process may unpickle them."""

from __future__ import annotations

import base64
import io
import pickle
from typing import Any

from snr_sim.grading.lab.verdicts import GraderError
from snr_sim.grading.remote.sent_code import LAB_MODULE
from snr_sim.prelude.scenario import RobotInfo
from snr_sim.scenario import library


def pickle_robot(robot: RobotInfo) -> str:
    """Return the pickled argument of a student's `factories`, for its process to unpack.

    Raises:
        GraderError: something in it is of a class that the student's process cannot know.
    """
    buffer = io.BytesIO()
    try:
        _RobotPickler(buffer).dump(robot)
    except GraderError:
        raise
    except Exception as error:
        raise GraderError(f"The argument of the student's `factories` cannot be sent: {error}") from error
    return base64.b64encode(buffer.getvalue()).decode()


class _RobotPickler(pickle.Pickler):
    """Refuses what only this process has loaded."""

    def persistent_id(self, value: Any) -> None:
        module = value.__module__ if isinstance(value, type) else type(value).__module__
        if str(module).startswith(_ONLY_HERE):
            raise GraderError(
                f"The argument of the student's `factories` holds {value!r}, whose class is defined in {module}.",
                fix="define such classes in the robot's folder, which the student's process may read.",
            )


_ONLY_HERE = (library.SCENARIO_MODULE, LAB_MODULE, "__main__")
