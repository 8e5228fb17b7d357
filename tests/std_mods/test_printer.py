"""One line for each task: time, id, and data."""

import io

import pytest

from snr_sim import ListReplayerFactory, PrinterEndpointFactory, SNRTestCase, TaskType, tasks
from snr_sim.testing.function_components import FunctionEndpointFactory


class Printing(SNRTestCase):
    def test_line_contains_node_time_task_and_data(self) -> None:
        stream = io.StringIO()
        self.run_test_node(
            [
                FunctionEndpointFactory(begin=lambda part: part.schedule(tasks.event("contact", ["left", 0.5]))),
                ListReplayerFactory([1.5], "depth"),
                PrinterEndpointFactory([TaskType.event, TaskType.store_page, (TaskType.process_data, "depth")], stream),
            ]
        )
        assert stream.getvalue().splitlines() == [
            "test_node     0.0000 s  event 'contact'  'left', 0.5",
            "test_node     0.0000 s  store_page 'depth'  1.5",
            "test_node     0.0000 s  process_data 'depth'  1.5",
        ]


def test_default_stream_is_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    SNRTestCase().run_test_node([ListReplayerFactory([1], "x"), PrinterEndpointFactory([(TaskType.process_data, "x")])])
    assert capsys.readouterr().out == "test_node     0.0000 s  process_data 'x'  1\n"
