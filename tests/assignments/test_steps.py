"""Where a comment in a starter names "Step 3", the third step of its page is about that code."""

import ast
import re
from pathlib import Path

import pytest

LABS = sorted((Path(__file__).parents[2] / "assignments").glob("[0-9]*"))


def steps(page: str) -> dict[int, str]:
    """What a page says of each step, without its commands."""
    begin, _, _ = page.partition("## How it is graded")
    parts = re.split(r"^\*\*(\d+)\. ?", re.sub(r"```.*?```", "", begin, flags=re.DOTALL), flags=re.MULTILINE)
    return {int(number): text for number, text in zip(parts[1::2], parts[2::2], strict=True)}


def around(source: str, line: int) -> str:
    """The function that contains a line; without one the line with the statement after it."""
    lines = source.splitlines()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and node.lineno <= line <= (node.end_lineno or 0) + 1:
            return "\n".join(lines[node.lineno - 1 : node.end_lineno])
    return "\n".join(lines[line - 1 : line + 1])


@pytest.mark.parametrize("lab", LABS, ids=lambda lab: lab.name)
def test_step_named_in_comment_matches_page(lab: Path) -> None:
    step_texts = steps((lab / "README.md").read_text())
    for file in (lab / "starter").glob("*.py"):
        source = file.read_text()
        for line, text in enumerate(source.splitlines(), 1):
            for number in re.findall(r"(?:# |\. |^)Step (\d+)", text):
                names = set(re.findall(r"\w+", around(source, line))) | {file.stem}
                meant = re.findall(r"`([^`]+)`", step_texts[int(number)])
                assert names & {word for one in meant for word in re.findall(r"\w+", one)}, (file.name, text)
