"""Pages that are dataclasses or Structs get all points, as dicts do."""

from dataclasses import replace
from pathlib import Path

import pytest

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import find_lab
from tests.assignments.mistakes import write_solution

# What is changed in the reference, file by file: each text for another.
TYPED: dict[str, dict[str, dict[str, str]]] = {
    "02_depth_hold": {
        "depth_hold.py": {
            "from snr_sim import": "from snr_sim.prelude.signals import PwmCommand\nfrom snr_sim import",
            '{"pulses_us": pulses, "is_armed": is_armed}': "PwmCommand(pulses_us=pulses, is_armed=is_armed)",
        }
    },
    "03_moving_average": {
        "smooth.py": {
            "LENGTH = 60\n": "from dataclasses import dataclass\n\nLENGTH = 60\n\n\n@dataclass(frozen=True)\n"
            "class Smooth:\n    altitude_m: float\n    velocity_mps: float\n",
            '{"altitude_m": altitude_m, "velocity_mps": velocity_mps}': "Smooth(altitude_m, velocity_mps)",
        },
        "pilot.py": {
            'smooth["altitude_m"]': "smooth.altitude_m",
            'smooth["velocity_mps"]': "smooth.velocity_mps",
        },
    },
    "05_mission_state_machine": {
        "mission.py": {
            "import math\n": "import math\n\nimport msgspec\n",
            "\ndef factories(": "\nclass State(msgspec.Struct):\n    state: str\n    gate: int\n"
            "    since_s: float\n\n\ndef factories(",
            '{"state": machine.state, "gate": machine.gate, "since_s": machine.since_s}': "State(machine.state, "
            "machine.gate, machine.since_s)",
        }
    },
}


@pytest.mark.parametrize(
    "lab", [pytest.param(lab, marks=[pytest.mark.nightly] * lab.startswith("05")) for lab in TYPED]
)
def test_reference_with_types_gets_all_points(lab: str, tmp_path: Path, warm_children: None) -> None:
    checks = find_lab(lab)
    checks.checks = tuple(replace(check, visible=check.visible[:1]) for check in checks.checks)
    write_solution(lab, tmp_path)
    for name, changes in TYPED[lab].items():
        text = (tmp_path / name).read_text()
        for before, after in changes.items():
            assert before in text
            text = text.replace(before, after)
        (tmp_path / name).write_text(text)
    graded = grade_submission(checks, tmp_path, None, isolation="none")
    lost = [(case.hint, case.error) for check in graded.checks for case in check.cases if not case.is_passed]
    assert (graded.points, lost) == (100.0, [])
