"""The student's submission as a check uses it: texts to read, functions to call, components to feed and to run.

The student's code runs in a process of its own (`child.py`), which starts when it is first needed.
Its failures are raised as `SubmissionError`, which the grader turns into a failed case: a check need not catch it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import msgspec

from snr_sim.grading.lab.answers import checked
from snr_sim.grading.lab.submission import Submission
from snr_sim.grading.remote import protocol
from snr_sim.grading.remote.sent_code import code_to_send
from snr_sim.grading.remote.student_process import CALL_CPU_S, StudentProcess
from snr_sim.prelude.values import encode_value

if TYPE_CHECKING:
    from snr_sim.grading.lab.scenario_run import ScenarioRun
    from snr_sim.grading.lab.stimulus import Output, Stimulus


class Student(Submission):
    """One submission, for one case; close it in the end, or use `with`. Arguments as for `Submission`."""

    _child: StudentProcess | None = None  # of this case's calls

    def __enter__(self) -> Student:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def call(
        self,
        file: str,
        function: str,
        *args: Any,
        returns: Any = Any,
        finite: bool = True,
        budget_s: float = CALL_CPU_S,
    ) -> Any:
        """Call a function of a submitted file, in the student's process, and return what it returns.

        Several calls in one case use the same process, so the file's module state persists.

        Args:
            args: numbers, texts, lists, tuples, dicts, arrays.
            returns: required type of the result, such as `float`, `list[float]` or `dict[str, int]`.
            finite: whether nan and inf are refused.
            budget_s: CPU time it may take.

        Returns:
            numbers, texts, lists or dicts of these: a tuple comes back as a list, an array as lists.

        Raises:
            SubmissionError: the program raised, was too slow, or returned another type.
        """
        verb = protocol.Call(file, function, msgspec.Raw(encode_value(list(args))))
        return checked(f"{file}: {function}(...)", self.child(file).ask(verb, budget_s).result(), returns, finite)

    def create_object(self, file: str, kind: type[Any], *args: Any, budget_s: float = CALL_CPU_S) -> RemoteObject:
        """Create an object of snr_sim or the lab in the student's process, around the student's module.

        For frequent, short exchanges: the object loops there, over many observations in one message.

        Args:
            file: of the submission; the class gets it as a module, first, and `args` after it.
            kind: a class of snr_sim, or of a module in the lab's folder. That module is sent to the process, where the
                student can read it; it imports nothing else of the lab.
            budget_s: CPU time it may take.

        Raises:
            SubmissionError: as for `call`.
            GraderError: the class belongs to neither.
        """
        verb = protocol.MakeObject(file, code_to_send(kind), msgspec.Raw(encode_value(list(args))))
        child = self.child(file)
        return RemoteObject(child, protocol.decode_as(_decode_number, child.ask(verb, budget_s).result()), file)

    def run_inputs(self, file: str, pages: Sequence[Stimulus], **details: Any) -> list[Output]:
        """Bring pages and tasks to the components of a submitted file; see `stimulus.run_inputs`."""
        from snr_sim.grading.lab.stimulus import run_inputs  # a slow import

        return run_inputs(self, file, pages, **details)

    def run_scenario(
        self,
        scenario: str,
        seed: int,
        controller: str,
        options: dict[str, str] | None = None,
        io: str = "sim",
        may_fail: bool = False,
        inputs: Sequence[Stimulus] = (),
    ) -> ScenarioRun:
        """Run a scenario with the components of a submitted file as its controller; see `scenario_run.run_scenario`."""
        from snr_sim.grading.lab.scenario_run import run_scenario

        return run_scenario(self, scenario, seed, controller, options or {}, io, may_fail, inputs)

    @property
    def printed(self) -> str:
        """What the program has printed so far, in all its processes."""
        return "\n".join(text for text in [*self._printed, self._child.printed if self._child else ""] if text)

    @property
    def cpu_time_s(self) -> float | None:
        """CPU time of the process of this case's calls, as the kernel counts it; None where it is not reported."""
        return None if self._child is None else self._child.cpu_time_s

    def child(self, file: str) -> StudentProcess:
        """Return the process of this case's calls, made when it is first needed."""
        if self._child is None:
            self._child = self.new_child(file)
        return self._child

    def close(self) -> None:
        """End the process of this case's calls; raise SubmissionError if it had printed too much."""
        if self._child is not None:
            child, self._child = self._child, None
            self.close_child(child)


class RemoteObject:
    """An object in the student's process; `Student.create_object` makes it."""

    def __init__(self, child: StudentProcess, number: int, file: str) -> None:
        self._child = child
        self._number = number
        self._file = file

    def ask(
        self, method: str, *args: Any, returns: Any = Any, finite: bool = True, budget_s: float = CALL_CPU_S
    ) -> Any:
        """Call a method of the object; answer and errors as for `Student.call`.

        `args` are finite numbers, texts, lists, dicts: encoded without further checks, and tuples become lists.
        """
        verb = protocol.AskObject(self._number, method, msgspec.Raw(protocol.encode(args)))
        return checked(f"{self._file}: {method}(...)", self._child.ask(verb, budget_s).result(), returns, finite)


_decode_number = msgspec.json.Decoder(int)
