"""Gradescope's container: `snr grade LAB --gradescope DIR` writes it, and in it `run_autograder` grades one submission.

    DIR/setup.sh        Gradescope runs it once, as root, when the image is built
    DIR/run_autograder  ... and this for each submission
    DIR/kit/            snr_sim as it is here, with its robots and scenarios, and the lab
    DIR/requirements.txt, secret, settings.json

Zip the content of DIR and upload it to Gradescope. There the zip is unpacked to /autograder/source, a submission is in
/autograder/submission, and the results are read from /autograder/results/results.json. Its containers are ordinary
ones, where even root may make no namespaces: there students' programs are confined (`confinement.py`), and
`extra_data` of the results reports it.

Source: "Autograder Specifications", gradescope-autograders.readthedocs.io.
"""

from __future__ import annotations

import importlib.metadata
import json
import re
import shutil
import sys
import tempfile
import traceback
from pathlib import Path

import msgspec

import snr_sim
from snr_sim import __version__
from snr_sim.grading.batch.member_names import SubmissionRejectedError
from snr_sim.grading.batch.submission_import import import_submission, remove
from snr_sim.grading.batch.worker import Job, grade, ungraded_result
from snr_sim.grading.lab.lab import Lab, load_lab
from snr_sim.grading.reports.results import Graded, RequestedIsolation, with_runs_named
from snr_sim.grading.reports.student_reports import gradescope_results
from snr_sim.prelude.errors import SnrError
from snr_sim.recording.atomic_files import write_atomic

_KIT = Path(snr_sim.__file__).resolve().parent
_EXTRAS = ("sim",)
_SKIPPED = shutil.ignore_patterns("__pycache__", "*.pyc", "shipped")
_NAME = "your submission"

_SETUP = """#!/usr/bin/env bash
# Gradescope runs this once, as root, when the image is built.
set -euo pipefail
cd /autograder/source
apt-get update -q
apt-get install -q -y --no-install-recommends python3 python3-venv
apt-get install -q -y --no-install-recommends bubblewrap || echo "Without bubblewrap: programs will confine themselves."
if ! python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
  apt-get install -q -y --no-install-recommends python3.11 python3.11-venv
  python=python3.11
fi
"${python:-python3}" -m venv /autograder/venv
/autograder/venv/bin/pip install -q -r requirements.txt
echo /autograder/source/kit > "$(echo /autograder/venv/lib/python3.*/site-packages)/snr_sim.pth"
chmod 600 secret
chmod -R go+rX kit  # students' programs run as users of their own, who read it
"""
_RUN = """#!/usr/bin/env bash
# Gradescope runs this for each submission. Whatever happens, there is a results.json afterwards.
root=${AUTOGRADER_ROOT:-/autograder}
mkdir -p "$root/results"
cd "$root"
"${AUTOGRADER_PYTHON:-$root/venv/bin/python}" -m snr_sim.grading.batch.gradescope "$root"
[ -s "$root/results/results.json" ] ||
  echo '{"output": "Not graded: the grader failed, not you.", "tests": []}' > "$root/results/results.json"
"""


def write_container(lab: Lab, secret: bytes, isolation: RequestedIsolation, out: Path) -> None:
    """Write the files that Gradescope needs into a new folder.

    Isolation is "required", or "none" to try it where programs cannot be isolated.

    Raises:
        SnrError: there is something in the folder already, or it cannot be written.
    """
    assert lab.folder is not None
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise SnrError(f"{out} is not empty.", fix="name a new folder with --gradescope.")
        kit = out / "kit" / "snr_sim"
        shutil.copytree(_KIT, kit, ignore=_SKIPPED)
        for kind in ("robots", "scenarios"):
            shipped = _KIT / "shipped" / kind
            content = shipped if shipped.is_dir() else _KIT.parent / kind
            shutil.copytree(content, kit / "shipped" / kind, ignore=_SKIPPED)
        shutil.copytree(lab.folder, kit / "shipped" / "assignments" / lab.name, ignore=_SKIPPED)
        write_atomic(out / "secret", secret + b"\n", mode=0o600)
        write_atomic(out / "settings.json", json.dumps({"lab": lab.name, "isolation": isolation}).encode() + b"\n")
        write_atomic(out / "requirements.txt", "".join(f"{line}\n" for line in requirements()).encode())
        write_atomic(out / "setup.sh", _SETUP.encode(), mode=0o755)
        write_atomic(out / "run_autograder", _RUN.encode(), mode=0o755)
    except OSError as error:
        raise SnrError(f"{out} could not be written: {error}.", fix="name another folder.") from error


def requirements() -> list[str]:
    """Return the requirements for pip of snr_sim with its simulation."""
    found = []
    for line in importlib.metadata.requires("snr_sim") or []:
        name, _, marker = line.partition(";")
        extra = re.search(r"extra == '([^']+)'", marker.replace('"', "'"))
        if extra is None or extra[1] in _EXTRAS:
            found.append(name.strip())
    return found


def grade_in_container(root: Path) -> Graded:
    """Grade the submission in a container, and write its results.json; `root` is /autograder in Gradescope."""
    source = root / "source"
    settings = json.loads((source / "settings.json").read_text())
    checks = _KIT / "shipped" / "assignments" / settings["lab"] / "checks.py"
    if not checks.is_file():  # not the copy in the container: a test, or another installation of snr_sim
        checks = source / "kit" / "snr_sim" / "shipped" / "assignments" / settings["lab"] / "checks.py"
    secret = (source / "secret").read_bytes().strip()
    place = Path(tempfile.mkdtemp(prefix="snr_grade_"))
    place.chmod(0o711)
    job = Job(_NAME, str(checks), str(place / "submission"), secret, settings["isolation"], str(place / "runs"))
    try:
        graded = _graded(job, root / "submission")
    finally:
        remove(place)
    (root / "results").mkdir(exist_ok=True)
    write_atomic(root / "results" / "results.json", gradescope_results(graded).encode())
    return graded


def _graded(job: Job, given: Path) -> Graded:
    try:
        lab = load_lab(Path(job.lab))
        taken = import_submission(given, lab.files, Path(job.folder))
    except SubmissionRejectedError as rejection:
        return ungraded_result(job, "rejected", str(rejection), lab.title)
    except Exception:
        return ungraded_result(job, "grader_error", traceback.format_exc())
    without_runs = with_runs_named(grade(job), lambda run: "")  # Gradescope does not hand them out
    return msgspec.structs.replace(without_runs, notes=taken.notes)


if __name__ == "__main__":
    outcome: Graded = grade_in_container(Path(sys.argv[1]))
    if outcome.status == "grader_error":
        print(f"snr_sim {__version__}: {outcome.error}")  # Gradescope shows it to the instructor alone  # noqa: T201
