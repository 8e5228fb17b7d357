"""The student's side of the lab: brings events to their watchdog and their plan. It runs in the student's process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any

from snr_sim.errors import ConfigError
from snr_sim.supervision import Supervisor
from snr_sim.supervision.tree import Order, Tree

TICK_S = 0.1


class Bench:
    """What the student's module does with given stories."""

    def __init__(self, module: ModuleType) -> None:
        self._module = module

    def hanging(self, story: Sequence[Sequence[Any]]) -> list[list[str]]:
        """Return what a new watchdog answers to each question of a story: [method, *arguments]."""
        watchdog = self._module.Watchdog()
        answers = []
        for method, *arguments in story:
            answer = getattr(watchdog, method)(*arguments)
            if method == "hanging":
                if not isinstance(answer, (list, tuple, set)):
                    raise ConfigError(f"hanging returns {answer!r}.", fix="return a list of names, empty for none.")
                answers.append(list(answer))
        return answers

    def processes(self) -> list[str]:
        """Return the names of the processes of the plan."""
        return [process.name for process in Tree(self._plan()).root.processes()]

    def orders(
        self, events: Sequence[tuple[float, str, str]], setup_s: Mapping[str, float], until_s: float
    ) -> list[tuple[float, str, str]]:
        """Return the orders that the plan leads to: time, "start", "end", "kill" or "safe stop", and the process.

        Args:
            events: what happens to a process, at a time: "fails"; "finishes", without a failure; "freezes", so that it
                reports no more; or "stop", of all. All others report in each tick, and end when they are asked to.
            setup_s: how long processes need from their start to their first report.
            until_s: end of the story.
        """
        tree, log = Tree(self._plan()), list[tuple[float, str, str]]()
        alive: dict[str, float] = {}  # by process, from when on it reports
        frozen: set[str] = set()

        def follow(orders: list[Order], now_s: float) -> None:
            for what, name in orders:
                log.append((now_s, what, name))
                if what == "start":
                    alive[name] = now_s + setup_s.get(name, 0.0)
                    frozen.discard(name)
                elif what in ("end", "kill") and alive.pop(name, None) is not None:
                    follow(tree.ended(name, 0, "", now_s), now_s)

        follow(tree.begin(0.0), 0.0)
        left = sorted(events)
        for i in range(1, round(until_s / TICK_S) + 1):
            now_s = i * TICK_S
            for name, from_s in list(alive.items()):
                if from_s <= now_s and name not in frozen:
                    tree.petted(name, now_s)
            while left and left[0][0] <= now_s:
                _, what, name = left.pop(0)
                if what == "stop":
                    follow(tree.stop(now_s), now_s)
                elif name in alive and what == "freezes":
                    frozen.add(name)
                elif alive.pop(name, None) is not None:
                    follow(tree.ended(name, int(what == "fails"), "it failed", now_s), now_s)
            follow(tree.tick(now_s), now_s)
        return log

    def _plan(self) -> Supervisor:
        plan = self._module.plan()
        if not isinstance(plan, Supervisor):
            raise ConfigError(f"plan() returns {type(plan).__name__}.", fix='return Supervisor("root", [...]).')
        return plan
