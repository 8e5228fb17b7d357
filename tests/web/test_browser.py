"""The live page in a real browser, over runs in real time: what a student sees, and what an edit does."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from snr_sim.web.explanation import TIMEOUT_S

pytestmark = [pytest.mark.slow, pytest.mark.unmeasured]
PACKAGES = "chromium"
# What would otherwise ask other hosts, and what needs a screen.
FLAGS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
LAPTOP, TABLET = (1280, 800), (1024, 768)
WAIT_S = 20.0  # of what takes some milliseconds, on a computer that does much else
PROCESS_S = TIMEOUT_S  # of a process that starts, or executes the run again: up to 2 s of CPU time
# Dark from 1 s to 2 s, from 3 s to 4 s, and so on; `turns` counts its entries. It reads no sensor.
BLINKER = """\
(var near_cm := [25])
(machine blink
  (event bump [robot.left_touch.read() == 7])
  (var turns := [0])
  (state lit (onentry [turns = turns + 1]))
  (state dark (onentry [turns = turns + 1]))
  (state broken)
  (ontime 1000 lit -> dark)
  (ontime 1000 dark -> lit)
  (on bump lit -> broken)
  (on halt lit -> broken)
  (event halt))
(spawn blink lit)
"""
NEAR_CM = "(var near_cm := ["


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Return a browser; skip where there is none, but not in CI. Not for the whole session: it has an event loop."""
    path = shutil.which("chromium")
    if path is None:
        if os.environ.get("SNR_REQUIRE_BROWSER"):
            raise FileNotFoundError(f"There is no chromium: sudo apt install {PACKAGES}")
        pytest.skip(f"There is no chromium here: sudo apt install {PACKAGES}")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield running
        running.close()


LIVE = ("run", "dora_room", "--controller", "program.lrp", "--speed", "real", "--live")


@pytest.fixture
def running() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Return a list of processes, which end with the test."""
    processes: list[subprocess.Popen[bytes]] = []
    yield processes
    for process in processes:
        process.kill()
        process.wait(WAIT_S)


@pytest.fixture
def start(tmp_path: Path, running: list[subprocess.Popen[bytes]]) -> Callable[..., str]:
    """Return a function that starts a command, a live run if not given, and returns the address of its page."""
    output = tmp_path / "output"

    def started(program: str, words: Sequence[str] = LIVE) -> str:
        (tmp_path / "program.lrp").write_text(program)
        with output.open("wb") as file:
            command = [sys.executable, "-m", "snr_sim", *words]
            running.append(subprocess.Popen(command, cwd=tmp_path, stdout=file, stderr=file))
        return str(wait_for(lambda: re.search(r"http://\S+token=\S+", output.read_text()), PROCESS_S)[0])

    return started


@pytest.fixture
def open_page(browser: Any) -> Iterator[Callable[..., Any]]:
    """Return a function that opens a page in a browser of its own; afterwards check what it logged and asked for."""
    problems: list[str] = []
    contexts: list[Any] = []

    def opened(url: str, size: tuple[int, int] = LAPTOP, **options: Any) -> Any:
        host = urlsplit(url).netloc
        context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **options)
        contexts.append(context)
        context.set_default_timeout(1000 * WAIT_S)
        page = context.new_page()
        page.on("console", lambda one: problems.append(f"{one.type}: {one.text}"))
        page.on("pageerror", lambda error: problems.append(f"error: {error}"))
        context.on("request", lambda one: problems.extend([one.url] if is_elsewhere(one.url, host) else []))
        page.goto(url)
        page.wait_for_selector("#diagram .active")
        return page

    yield opened
    for one in contexts:
        one.close()
    assert problems == []


def is_elsewhere(url: str, host: str) -> bool:
    """Return whether a request leaves the page's own server."""
    return urlsplit(url).scheme not in ("data", "blob") and urlsplit(url).netloc != host


def wait_for(check: Callable[[], Any], limit_s: float = WAIT_S) -> Any:
    """Return the first true value of a function."""
    end_s = time.monotonic() + limit_s
    while not (found := check()):
        assert time.monotonic() < end_s, "it did not happen"
        time.sleep(0.02)
    return found


def active(page: Any) -> list[str]:
    """Return the names of the states that are drawn as active."""
    return [one.text_content() for one in page.locator("#diagram .active > .name").all()]


def shown_s(page: Any) -> float:
    """Return the time that the page shows."""
    return float(page.locator("#shown").inner_text().split()[0])


def show(page: Any, t_s: float) -> None:
    """Move the slider."""
    move = "([slider, t]) => { slider.value = t; slider.dispatchEvent(new Event('input')); }"
    page.evaluate(move, [page.locator("#slider").element_handle(), t_s])


def value(page: Any, path: str) -> str:
    """Return the value of a variable that the page shows."""
    return str(page.get_by_label(path, exact=True).input_value())


def program(page: Any) -> str:
    """Return the text in the editor."""
    return "\n".join(line.text_content() for line in page.locator(".cm-line").all())


def put_cursor_in(page: Any, text: str, closing: str = "])") -> None:
    """Put the cursor before the brackets at the end of a line."""
    page.locator(".cm-line", has_text=text).first.click()
    page.keyboard.press("End")
    for _ in closing:
        page.keyboard.press("ArrowLeft")


@pytest.mark.parametrize(
    "limit_s", [pytest.param(10.0, id="beside-others"), pytest.param(3.0, id="alone", marks=pytest.mark.wall_clock)]
)
def test_page_of_new_run_shows_first_state_soon(start: Callable[..., str], open_page: Any, limit_s: float) -> None:
    url = start(BLINKER)
    took_s = []
    for _ in range(3):  # what else runs on this computer can only add to it
        begun_s = time.monotonic()
        page = open_page(url)
        took_s.append(time.monotonic() - begun_s)
    print("s until the first state is shown:", took_s)
    assert min(took_s) < limit_s
    assert set(active(page)) <= {"lit", "dark"}
    assert "token" not in page.url
    assert page.locator("#diagram .unreachable").count() == 0
    assert page.locator("#diagram .state").count() == 3


def test_broken_text_is_marked_at_its_line_while_robot_continues(start: Callable[[str], str], open_page: Any) -> None:
    page = open_page(start(BLINKER))
    put_cursor_in(page, "(ontime 1000 dark", ")")
    page.keyboard.type(" xx yy")
    marker = page.locator(".cm-lint-marker-error")
    marker.wait_for()
    line = page.locator(".cm-line", has_text="xx").bounding_box()
    assert abs(marker.bounding_box()["y"] - line["y"]) < line["height"]
    assert page.locator("#problems").inner_text().startswith("line 9")
    before_s, was_active = shown_s(page), active(page)
    wait_for(lambda: shown_s(page) > before_s + 0.6)  # 60 steps
    wait_for(lambda: active(page) != was_active)
    assert page.locator("#status").inner_text() == "live"


@pytest.mark.parametrize(
    "p95_s", [pytest.param(0.4, id="beside-others"), pytest.param(0.1, id="alone", marks=pytest.mark.wall_clock)]
)
def test_edit_takes_effect_soon_after_its_key(start: Callable[[str], str], open_page: Any, p95_s: float) -> None:
    page = open_page(start(BLINKER))
    put_cursor_in(page, NEAR_CM)
    watch = """number => {
        window.took_ms = undefined;
        let key_ms;
        addEventListener("keydown", () => (key_ms = performance.now()), { capture: true, once: true });
        new MutationObserver((_, observer) => {
            if (document.body.dataset.program === number) return;
            observer.disconnect();
            window.took_ms = performance.now() - key_ms;
        }).observe(document.body, { attributes: true });
    }"""
    p95_ms = []
    for _ in range(3):  # what else runs on this computer can only add to it
        took_ms = []
        for i in range(30):
            page.evaluate(watch, page.evaluate("document.body.dataset.program"))
            page.keyboard.press("Backspace" if i % 2 else "0")
            took_ms.append(wait_for(lambda: page.evaluate("window.took_ms")))
        print("ms from a key to the first state of its program:", sorted(map(round, took_ms)))
        p95_ms.append(sorted(took_ms)[28])
        if p95_ms[-1] < 1000 * p95_s:
            break
    assert min(p95_ms) < 1000 * p95_s


def test_variable_set_in_one_browser_is_shown_in_another(start: Callable[[str], str], open_page: Any) -> None:
    url = start(BLINKER)
    page, other = open_page(url), open_page(url, TABLET)
    field = page.get_by_label("near_cm", exact=True)
    field.fill("31.5")
    field.press("Enter")
    wait_for(lambda: value(other, "near_cm") == "31.5")
    field.fill("far")
    field.press("Enter")
    wait_for(lambda: page.locator("#message").inner_text() == "near_cm must be a number, not 'far'.")
    wait_for(lambda: value(page, "near_cm") == "31.5")


def test_reader_may_look_and_not_touch(tmp_path: Path, start: Callable[..., str], open_page: Any) -> None:
    start(BLINKER)
    found = wait_for(lambda: re.search(r"http://\S+read=\S+", (tmp_path / "output").read_text()))
    page = open_page(found[0])
    assert all(page.locator(f"#{name}").is_disabled() for name in ("pause", "go", "step", "undo"))
    assert page.get_by_label("near_cm", exact=True).is_disabled()
    page.locator(".cm-line").first.click()
    page.keyboard.type("x")
    assert program(page) == BLINKER


def test_end_of_run_leaves_the_page_and_says_why(start: Callable[..., str], open_page: Any, running: Any) -> None:
    page = open_page(start(BLINKER))
    running[0].terminate()
    wait_for(lambda: page.locator("#status").inner_text() == "ended")
    assert "The run has ended" in page.locator("#message").inner_text()
    assert set(active(page)) <= {"lit", "dark"}
    with page.expect_download() as download:
        page.get_by_role("button", name="Save file").click()
    assert download.value.path().read_text() == BLINKER


def test_slider_shows_states_and_values_of_a_moment(start: Callable[[str], str], open_page: Any) -> None:
    page = open_page(start(BLINKER))
    wait_for(lambda: shown_s(page) > 4.5)
    for t_s, state, turns in ((1.5, "dark", "2"), (2.5, "lit", "3"), (3.5, "dark", "4")):
        show(page, t_s)
        wait_for(lambda turns=turns: value(page, "blink.turns") == turns)
        assert (active(page), page.locator("#status").inner_text()) == ([state], "past")
        assert page.get_by_label("blink.turns", exact=True).is_disabled()
    page.get_by_label("Previous transition").click()
    wait_for(lambda: shown_s(page) == 3.0)
    page.get_by_label("Moment of the run").press("ArrowLeft")
    wait_for(lambda: shown_s(page) == 2.0)
    wait_for(lambda: active(page) == ["lit"])
    page.get_by_role("button", name="Newest").click()
    wait_for(lambda: page.locator("#status").inner_text() == "live" and shown_s(page) > 4.5)


def test_text_of_a_moment_is_that_of_its_program(start: Callable[[str], str], open_page: Any) -> None:
    page = open_page(start(BLINKER))
    wait_for(lambda: shown_s(page) > 1.0)
    put_cursor_in(page, NEAR_CM)
    page.keyboard.type("0")
    wait_for(lambda: page.evaluate("document.body.dataset.program") == "2")
    show(page, 0.5)
    wait_for(lambda: program(page) == BLINKER)
    assert page.locator(".cm-content").get_attribute("aria-label") == "Program, read only"
    page.get_by_role("button", name="Newest").click()
    wait_for(lambda: "[250]" in program(page))
    page.get_by_role("button", name="Undo").click()
    wait_for(lambda: program(page) == BLINKER)
    assert value(page, "near_cm") == "25"


def test_edit_of_another_browser_is_shown_or_is_a_conflict(start: Callable[[str], str], open_page: Any) -> None:
    url = start(BLINKER)
    page, other = open_page(url), open_page(url)
    put_cursor_in(page, NEAR_CM)
    page.keyboard.type("1")
    wait_for(lambda: "[251]" in program(other))
    put_cursor_in(other, "(ontime 1000 dark", ")")
    other.keyboard.type(" xx yy")  # a mistake: it does not run
    other.locator(".cm-lint-marker-error").wait_for()
    page.keyboard.type("2")
    other.locator("#conflict").wait_for()
    assert "xx" in program(other)
    other.get_by_role("button", name="Take that text").click()
    wait_for(lambda: program(other) == program(page) and "[2512]" in program(other))
    assert other.locator(".cm-lint-marker-error").count() == 0


def test_stale_edit_is_refused_and_may_be_kept(start: Callable[[str], str], open_page: Any, browser: Any) -> None:
    url = start(BLINKER)
    other = open_page(url)
    context = browser.new_context()
    page = context.new_page()

    def without_programs(socket: Any) -> None:
        server = socket.connect_to_server()
        server.on_message(lambda text: None if '"kind":"program"' in text else socket.send(text))

    page.route_web_socket(re.compile("socket$"), without_programs)
    page.goto(url)
    page.wait_for_selector("#diagram .active")
    put_cursor_in(other, NEAR_CM)
    other.keyboard.type("1")
    wait_for(lambda: value(other, "near_cm") == "251")
    put_cursor_in(page, NEAR_CM)
    page.keyboard.type("7")
    page.locator("#conflict").wait_for()
    assert value(other, "near_cm") == "251"
    page.get_by_role("button", name="Keep mine").click()
    wait_for(lambda: value(other, "near_cm") == "257" and "[257]" in program(other))
    context.close()


def test_reload_keeps_the_moment_and_the_unfinished_text(start: Callable[[str], str], open_page: Any) -> None:
    page = open_page(start(BLINKER))
    wait_for(lambda: shown_s(page) > 2.0)
    put_cursor_in(page, "(ontime 1000 dark", ")")
    page.keyboard.insert_text(" xx yy")  # at once: the space alone runs, and would be the text of now but not of 1.5 s
    page.locator(".cm-lint-marker-error").wait_for()
    show(page, 1.5)
    wait_for(lambda: value(page, "blink.turns") == "2")
    page.reload()
    wait_for(lambda: active(page) == ["dark"])
    assert (shown_s(page), page.locator("#status").inner_text()) == (1.5, "past")
    page.locator(".cm-lint-marker-error").wait_for()
    assert "(ontime 1000 dark -> lit xx yy)" in program(page)


def test_keyboard_reaches_why_and_run_buttons(start: Callable[[str], str], open_page: Any) -> None:
    page = open_page(start(BLINKER))
    wait_for(lambda: shown_s(page) > 2.2)
    page.locator("#diagram [tabindex='0']").focus()
    labels = "document.activeElement.getAttribute('aria-label') ?? ''"
    wait_for(lambda: page.keyboard.press("ArrowRight") or "from lit to dark" in page.evaluate(labels))
    page.keyboard.press("Enter")
    page.locator("#why-rows", has_text="looked at").wait_for(timeout=1000 * PROCESS_S)
    assert "lit->dark" in page.locator("#why-title").inner_text()
    assert "1.00 s" in page.locator("#why-moments").inner_text()
    page.keyboard.press("Escape")
    assert page.locator("#why").is_hidden()
    assert "from lit to dark" in page.evaluate(labels)
    page.keyboard.press("Alt+p")
    wait_for(lambda: page.locator("#status").inner_text() == "paused")
    page.keyboard.press("Alt+s")
    page.keyboard.press("Alt+g")
    wait_for(lambda: page.locator("#status").inner_text() == "live")


def test_edits_are_tried_in_a_simulation_before_they_are_committed(start: Callable[[str], str], open_page: Any) -> None:
    page = open_page(start(BLINKER))
    page.keyboard.press("Alt+t")
    put_cursor_in(page, "(ontime 1000 dark", ")")
    page.keyboard.type(" xx yy")
    page.locator(".cm-lint-marker-error").wait_for()  # it is checked
    for _ in " xx yy":
        page.keyboard.press("Backspace")
    page.locator(".cm-lint-marker-error").wait_for(state="detached")
    page.keyboard.press("Home")
    for _ in range(len("  (ontime 1000") - 2):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Backspace")  # 100 ms
    assert "(ontime 100 dark -> lit)" in program(page)
    wait_for(lambda: shown_s(page) > 2.2)
    page.keyboard.press("Alt+r")
    lists = page.locator("#rehearsed ol")
    lists.first.wait_for(timeout=1000 * PROCESS_S)
    without, edited = (one.locator("li").all_inner_texts() for one in lists.all())
    assert 9 <= len(without) <= 10
    assert 17 <= len(edited) <= 20
    assert page.locator("#rehearsed .first").count() == 2
    assert page.evaluate("document.body.dataset.program") == "1"
    page.keyboard.press("Alt+c")
    wait_for(lambda: page.evaluate("document.body.dataset.program") == "2")
    assert page.locator("#trial").is_hidden()


def test_text_that_is_tried_survives_a_reload_and_can_be_discarded(start: Callable[[str], str], open_page: Any) -> None:
    page = open_page(start(BLINKER))
    page.get_by_role("button", name="Try").click()
    put_cursor_in(page, NEAR_CM)
    page.keyboard.type("0")
    page.reload()
    wait_for(lambda: "[250]" in program(page))
    wait_for(lambda: page.locator("#trial").is_visible())
    before_s = shown_s(page)
    wait_for(lambda: shown_s(page) > before_s + 0.5)
    assert value(page, "near_cm") == "25"
    page.get_by_role("button", name="Discard").click()
    assert page.locator("#trial").is_hidden()
    assert program(page) == BLINKER
    assert page.evaluate("document.body.dataset.program") == "1"


IMPORTED = """\
(export winks)
(machine winks
  (state open)
  (state shut)
  (ontime 500 open -> shut)
  (ontime 500 shut -> open))
"""


def test_imported_file_is_edited_with_its_mistakes_counts_and_undo(
    tmp_path: Path, start: Callable[[str], str], open_page: Any
) -> None:
    (tmp_path / "winks.lrp").write_text(IMPORTED)
    main = f'(import "winks.lrp")\n{BLINKER}(spawn winks open)\n'
    page = open_page(start(main))
    file = page.get_by_label("File")
    wait_for(lambda: page.locator("#diagram .state").count() == 5)
    file.select_option("winks.lrp")
    wait_for(lambda: program(page) == IMPORTED)
    wait_for(lambda: page.locator(".cm-counts .cm-gutterElement", has_text="×").count() >= 2)
    put_cursor_in(page, "(ontime 500 open", ")")
    page.keyboard.type("t")
    page.locator(".cm-lint-marker-error").wait_for()
    assert page.locator("#problems").inner_text().startswith("line 5 There is no state 'shutt' here.")
    file.select_option("")
    assert "does not run" in page.locator("#message").inner_text()
    wait_for(lambda: file.input_value() == "winks.lrp")
    page.keyboard.press("Backspace")
    page.locator(".cm-lint-marker-error").wait_for(state="detached")
    page.locator(".cm-line", has_text="(ontime 500 open").click()
    page.keyboard.press("Home")
    for _ in "  (ontime 5":
        page.keyboard.press("ArrowRight")
    page.keyboard.type("0")  # 5000 ms
    wait_for(lambda: page.evaluate("document.body.dataset.program") == "2")
    file.select_option("")
    wait_for(lambda: program(page) == main)
    page.get_by_role("button", name="Undo").click()
    wait_for(lambda: page.evaluate("document.body.dataset.program") == "3")
    page.locator("#diagram .name", has_text="shut").click()
    wait_for(lambda: program(page) == IMPORTED)
    assert file.input_value() == "winks.lrp"


def test_recorded_run_is_shown_at_any_moment(
    tmp_path: Path, start: Callable[..., str], open_page: Any, running: Any
) -> None:
    text = BLINKER.replace("(ontime 1000 dark -> lit)", "(ontime 1500 dark -> lit)")
    (tmp_path / "program.lrp").write_text(text)
    run = ["run", "dora_wall", "--controller", "program.lrp", "--out", "runs"]
    subprocess.run([sys.executable, "-m", "snr_sim", *run], cwd=tmp_path, capture_output=True, check=False)
    (folder,) = (tmp_path / "runs").glob("dora_wall-*")
    page = open_page(start(text, ["machine", "view", str(folder)]))
    assert page.locator("#status").inner_text() == "recorded"
    assert all(page.locator(f"#{name}").is_disabled() for name in ("pause", "go", "step", "undo"))
    for t_s, state in ((0.5, "lit"), (1.5, "dark"), (2.4, "dark"), (2.6, "lit")):
        show(page, t_s)
        wait_for(lambda t_s=t_s, state=state: shown_s(page) == t_s and active(page) == [state])
    assert page.get_by_label("near_cm", exact=True).is_disabled()
    running[0].terminate()
    running[0].wait(WAIT_S)
    wait_for(lambda: page.locator("#status").inner_text() in ("ended", "no connection"))


def test_signal_button_moves_the_machine_and_is_announced(start: Callable[[str], str], open_page: Any) -> None:
    page = open_page(start(BLINKER.replace("1000", "600000")))
    page.get_by_role("button", name="halt", exact=True).click()
    wait_for(lambda: active(page) == ["broken"])
    wait_for(lambda: "lit to broken" in page.locator("#announcement").text_content())
    assert page.locator("#diagram .last .label").all_text_contents() == ["halt"]
    assert page.locator(".cm-last").inner_text().strip() == "(on halt lit -> broken)"
    assert page.locator(".cm-counts .cm-gutterElement", has_text=re.compile("^1×$")).count() == 1


def test_count_at_a_line_lists_all_moments(start: Callable[..., str], open_page: Any) -> None:
    page = open_page(start(BLINKER))
    wait_for(lambda: shown_s(page) > 3.2)
    page.locator(".cm-line").first.click()
    page.keyboard.press("Home")
    page.keyboard.type("(\n")  # a mistake, and now the lines below are others than those that run
    page.locator(".cm-lint-marker-error").first.wait_for()
    line = page.locator(".cm-line", has_text="(ontime 1000 lit -> dark)").bounding_box()
    page.mouse.click(page.locator(".cm-counts").bounding_box()["x"] + 5, line["y"] + 5)
    assert page.locator("#why-title").inner_text() == "lit->dark: lit → dark"
    assert {"1.00 s", "3.00 s"} <= set(page.locator("#why-moments button").all_inner_texts())
    page.locator("#why-moments button", has_text="1.00 s").click()
    wait_for(lambda: shown_s(page) == 1.0 and active(page) == ["dark"])


def test_text_of_a_program_is_never_html(start: Callable[[str], str], open_page: Any) -> None:
    markup = '<img src=x onerror="document.title=1">'
    text = BLINKER.replace("(on bump", f"(on ['{markup}' == ''] dark -> broken)\n  (on bump")
    text = text.replace("[25]", f"['{markup}']").replace("robot.left_touch.read() == 7", f"near_cm < '{markup}'")
    page = open_page(start(text))
    assert value(page, "near_cm") == markup
    page.locator("#diagram .arrow").last.click(force=True)
    assert page.locator("img").count() == 0
    assert page.title() != "1"


@pytest.mark.parametrize("size", [LAPTOP, TABLET], ids=["laptop", "tablet"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_page_fits_the_screen(start: Callable[[str], str], open_page: Any, size: Any, scheme: str) -> None:
    page = open_page(start(BLINKER), size, color_scheme=scheme)
    overflow = (
        "document.documentElement.scrollHeight > innerHeight || document.documentElement.scrollWidth > innerWidth"
    )
    assert not page.evaluate(overflow)
    # No label of the diagram is over another one, and none is out of its machine.
    boxes = [one.bounding_box() for one in page.locator("#diagram :is(.label, .name)").all()]
    for i, one in enumerate(boxes):
        assert not any(is_overlap(one, other) for other in boxes[i + 1 :])
    for pair in ("--ink --surface", "--soft --surface", "--bad --surface", "--last --surface", "--ink --active"):
        assert contrast(page, *pair.split()) >= 4.5, pair  # WCAG 2.2, 1.4.3


LANDING = """\
(machine landing
  (state coasting (onentry [robot.throttle.stop()]))
  (state burning (onentry [robot.throttle.start(1.0)]))
  (on [robot.velocity_mps.read() is not None and robot.velocity_mps.read() < -900] coasting -> burning))
(spawn landing coasting)
"""


def test_names_of_parts_with_long_units_are_whole(start: Callable[..., str], open_page: Any) -> None:
    command = ("run", "lander_vertical", "--controller", "program.lrp", "--speed", "real", "--live")
    page = open_page(start(LANDING, command), TABLET)
    names = page.locator(":is(#reads, #drives) .name")
    wait_for(lambda: {"velocity_mps", "throttle"} <= set(names.all_inner_texts()))
    assert all(names.evaluate_all("all => all.map(one => one.clientWidth >= one.scrollWidth)"))


def is_overlap(one: dict[str, float], other: dict[str, float]) -> bool:
    """Return whether two rectangles have a common area."""
    return all(
        one[start] < other[start] + other[size] and other[start] < one[start] + one[size]
        for start, size in (("x", "width"), ("y", "height"))
    )


def contrast(page: Any, ink: str, paper: str) -> float:
    """Return the contrast ratio of two colours of the style, as WCAG 2.2 defines it."""
    read = "name => getComputedStyle(document.documentElement).getPropertyValue(name).trim()"
    light, dark = sorted((luminance(page.evaluate(read, one)) for one in (ink, paper)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def luminance(colour: str) -> float:
    """Return the relative luminance of a colour such as #16191d (WCAG 2.2)."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    red, green, blue = (one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue
