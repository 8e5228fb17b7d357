"""What the run of another user holds reaches the terminal as text: no verb prints a control sequence of it."""

import json
import logging
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rich.table import Table

from snr_sim import SNRTestCase
from snr_sim.cli.plain_console import escape_markup, plain_console
from snr_sim.prelude.text import visible
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import encode_record
from snr_sim.recording.trace import FILE_NAME
from snr_sim.testing.function_components import FunctionEndpointFactory

Snr = Callable[..., Any]
SEQUENCE = "\x1b]0;x\x07\x9b2J\u202e\r"
# Names and texts of the run, each of which another user may have changed.
WORDS = ["lander_node", "radar", "engine", "optimal", "lander_vertical", "landed", "altitude_m", "pymunk", "store_page"]
VERBS = {
    "trace": [["trace", "RUN"], ["trace", "RUN", "--json"]],
    "compare": [["compare", "RUN", "MINE"], ["compare", "RUN", "MINE", "--json"]],
    "replay": [["replay", "RUN"], ["replay", "RUN", "--trust"], ["replay", "RUN", "--trust", "--json"]],
    "resim": [["resim", "RUN"], ["resim", "RUN", "--trust", "--no-rrd"]],
    "machine": [["machine", "lag", "RUN"], ["machine", "why", "RUN"]],
}


@pytest.fixture
def mine(snr: Snr, here: Path) -> Path:
    """A run of one's own."""
    return Path(snr("run", "lander_vertical", "--no-rrd", "--json").json["run_dir"]).resolve()


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_control_sequences_of_a_run_are_shown_as_text(verb: str, mine: Path, here: Path, snr: Snr) -> None:
    text, escaped = (mine / FILE_NAME).read_text(), json.dumps(SEQUENCE)[1:-1]
    shown = 0
    for number, word in enumerate([*WORDS, "*"]):
        theirs = Path(shutil.copytree(mine, here / f"{number}"))
        pattern = r'": ?"[a-z]' if word == "*" else rf'"{word}'
        (theirs / FILE_NAME).write_text(re.sub(pattern, lambda found: found[0] + escaped, text))
        for words in VERBS[verb]:
            answer = snr(*({"RUN": theirs, "MINE": mine}.get(one, one) for one in words))
            assert visible(answer.out) == answer.out, words
            assert visible(answer.err) == answer.err, words
            shown += sum("u009b" in line or "x9b" in line for line in (answer.out, answer.err))
            if "--json" in words and answer.out and verb != "trace":
                json.loads(answer.out)
    assert shown or verb == "machine"  # where it was printed, it could be seen


def test_lines_of_trace_are_visible_and_as_json_of_the_same_values(mine: Path, snr: Snr) -> None:
    path = mine / FILE_NAME
    path.write_text(path.read_text().replace('"radar"', '"x\x9b\u202e\U000e0001"'))
    answer = snr("trace", mine, "--json")
    assert visible(answer.out) == answer.out
    recorded = [json.loads(encode_record(record)) for record in read_trace(path).records]
    assert list(map(json.loads, answer.out.splitlines())) == recorded
    text = snr("trace", mine).out
    assert visible(text) == text
    assert r"x\x9b\u202e\U000e0001" in text


def test_texts_of_rich_are_visible(capsys: pytest.CaptureFixture[str]) -> None:
    console = plain_console(width_in_a_pipe=200)
    table = Table(SEQUENCE, title=SEQUENCE, caption=SEQUENCE)
    table.add_row(SEQUENCE)
    console.print(table, SEQUENCE)
    console.print(SEQUENCE, style="dim")
    console.print(escape_markup(SEQUENCE))
    output = capsys.readouterr().out
    assert visible(output) == output
    assert output.count(r"\x9b2J\u202e") == 7


class Log(SNRTestCase):
    def test_log_message_with_text_of_a_peer_is_visible(self) -> None:
        with self.assertLogs("snr", logging.WARNING) as shown:
            self.run_test_node(
                [FunctionEndpointFactory(begin=lambda part: part.log.warning("%s of 100 %%: %s", 5, SEQUENCE))]
            )
        (record,) = shown.records
        assert record.getMessage() == visible(f"5 of 100 %: {SEQUENCE}")
