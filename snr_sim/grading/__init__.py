"""The grader: determines the points of a submission in a way that the submission cannot change."""

from typing import TYPE_CHECKING, TypeAlias

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.grading.lab.answers import require_field as require_field
    from snr_sim.grading.lab.answers import require_page as require_page
    from snr_sim.grading.lab.lab import Lab as Lab
    from snr_sim.grading.lab.lab import check as check
    from snr_sim.grading.lab.scenario_run import ScenarioRun as ScenarioRun
    from snr_sim.grading.lab.stimulus import Output as Output
    from snr_sim.grading.lab.stimulus import Stimulus as Stimulus
    from snr_sim.grading.lab.student import Student as Student
    from snr_sim.grading.lab.verdicts import CheckVerdict as _CheckVerdict
    from snr_sim.grading.lab.verdicts import SubmissionError as SubmissionError
    from snr_sim.grading.lab.verdicts import failed as failed
    from snr_sim.grading.lab.verdicts import partial_credit as partial_credit
    from snr_sim.grading.lab.verdicts import passed as passed

    Verdict: TypeAlias = _CheckVerdict  # the scenario's verdict is another class
else:
    # The process of a student's program imports this package, too, and needs none of it.
    __all__, __getattr__, __dir__ = lazy_names(__name__)
