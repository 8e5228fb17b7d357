"""Timelines of images and events, each with the states that the reference machine must be in."""

from __future__ import annotations

import random
from collections.abc import Sequence

from snr_sim.grading import Verdict, failed, passed

from .rules import Entry, reference_page
from .world import Timeline

SEGMENTS, ROUND = 24, ("NEAR", "PUSHED", "CLEAR", "BLOCKED")  # of `anything`

SEEN = "An image that shows stones: HEAP_SEEN, so 'search' goes to 'approach'."
STAYS = "While images show stones it stays in 'approach', until process_3d sends NEAR."
NONE = "Without stones in any image, HEAP_LOST comes 1.5 s after 'search' began, and not before."
LOST = "HEAP_LOST comes when no image has shown stones for 1.5 s, counted from the last that did, and not before."
OLD = "An image from before the state began does not count: compare its 'stamp_s' with self.entered_s."
AGAIN = "Each time a state is entered its time starts again. Keep times in self, and set them in enter()."


def seen(timeline: Timeline) -> None:
    """Stones in sight."""
    timeline.be("search", 0.8, NONE).be("approach", 1.0, SEEN, shows=True, slack_s=0.35)


def none_seen(timeline: Timeline) -> None:
    """No stones, then some."""
    timeline.be("search", 1.4, NONE).be("done", 1.0, NONE, slack_s=0.3)
    timeline.be("approach", 1.0, "In 'done' stones may show up: HEAP_SEEN.", shows=True, slack_s=0.35)


def lost(timeline: Timeline) -> None:
    """Out of sight while it approaches."""
    seen(timeline)
    timeline.be("approach", 1.2, LOST, shows=False).be("back_up", 1.0, LOST, slack_s=0.55)


def blinks(timeline: Timeline) -> None:
    """Out of sight for a moment, twice."""
    seen(timeline)
    for _ in range(2):
        timeline.be("approach", 1.1, LOST, shows=False).be("approach", 0.6, STAYS, shows=True)


def pushes(timeline: Timeline) -> None:
    """Work in which the blade hides the stones."""
    seen(timeline)
    timeline.be("push", 1.8, STAYS, event="NEAR", shows=False)
    timeline.be("back_up", 2.0, STAYS, event="PUSHED", shows=True)


def old_image(timeline: Timeline) -> None:
    """Stones in the last image of the state before, none in the next ones."""
    seen(timeline)
    timeline.be("push", 0.6, STAYS, event="NEAR").be("back_up", 0.6, STAYS, event="PUSHED").go_past_picture()
    timeline.be("search", 1.3, OLD, event="CLEAR", shows=False).be("done", 1.0, NONE, slack_s=0.4)


def again(timeline: Timeline) -> None:
    """Search twice."""
    timeline.be("search", 1.2, NONE).be("approach", 0.6, SEEN, shows=True, slack_s=0.35)
    timeline.be("push", 1.0, STAYS, event="NEAR", shows=False).be("back_up", 1.2, STAYS, event="BLOCKED")
    timeline.be("search", 1.3, AGAIN, event="CLEAR").be("done", 1.0, NONE, slack_s=0.4)


TIMELINES = {
    "stones in sight": seen,
    "no stones": none_seen,
    "out of sight": lost,
    "out of sight for a moment": blinks,
    "while it works": pushes,
    "an old image": old_image,
    "a second search": again,
}


def anything(seed: int) -> Timeline:
    """Return a timeline of images and of events of other processes at any times."""
    timeline, rng, place = Timeline(seed), random.Random(seed), 0
    for _ in range(SEGMENTS):
        timeline.shows = rng.random() < 0.7
        if rng.random() < 0.8:
            timeline.send(ROUND[place % len(ROUND)])
            place += 1
        else:
            timeline.send(rng.choice(ROUND))
        for _ in range(rng.randint(2, 24)):
            timeline.tick()
    return timeline


def judge_states(timeline: Timeline, entries: Sequence[Entry]) -> Verdict:
    """Judge the states of the reference machine by those that are right."""
    pages = [page for page in map(reference_page, entries) if page is not None]
    for expected in timeline.expected:
        at_begin = [page for page in pages if page.at_s <= expected.from_s + 1e-9][-1:]
        during = [page for page in pages if expected.from_s < page.at_s < expected.until_s - 1e-9]
        wrong = [page.state for page in (*at_begin, *during) if page.state != expected.state]
        if wrong or not at_begin:
            actual = f"'{wrong[0][:50]}'" if wrong else "nothing"
            when = f"from {expected.from_s:.2f} s to {expected.until_s:.2f} s"
            return failed(expected.hint, f"'{expected.state}' {when}", actual)
    return passed()


def judge_rest(entries: Sequence[Entry]) -> Verdict:
    """Judge whether it does nothing where the blade hides the stones."""
    state = ""
    for one in entries:
        page = reference_page(one)
        if page is not None:
            state = page.state if page.phase == "running" else ""
        elif one.source == "process_2d" and state in ("push", "back_up"):
            hint = f"In '{state}' it must neither look nor send an event: the blade hides the stones."
            return failed(hint, "nothing", one.name)
    return passed()
