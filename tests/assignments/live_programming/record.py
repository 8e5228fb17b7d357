"""Writes the edited run of the reference: python -m tests.assignments.live_programming.record

It prints the digest of the run that stays caught, too, for `CAUGHT_CHANGES`.

Needed when the physics of Dora or the digest of changes has changed. The edits come at fixed times, as `--watch` would
bring them: that a run with `--watch` gives the same is tested in tests/cli/test_machine_edits.py.
"""

from dataclasses import replace
from pathlib import Path

from snr_sim.scenario.machine_edits import Edits, changes_again, write

HERE = Path(__file__).parent
TRAP = HERE.parents[2] / "assignments" / "12_live_programming" / "starter" / "trap.lrp"
SCENARIO, SEED = "dora_corners", 0
CAUGHT_CHANGES = "c15bd200213d5695a65e64f315a57925"  # digest of what follows the edits of `caught_edits`


def edits() -> Edits:
    """Return the run: a bracket is lost, then three programs follow, each in one more place another one."""
    trap = TRAP.read_text(encoding="utf-8")
    one_side = trap.replace("side = -side", "side = 1")
    further = one_side.replace("(ontime 1000 ", "(ontime 2500 ")
    by_chance = (
        further.replace("(var side := [1])", "(var side := [1])\n  (var turn_ms := [2500])")
        .replace("side = 1\n", "side = 1 if random() < 0.5 else -1\n    turn_ms = 2000 + int(random() * 4000)\n")
        .replace("(ontime 2500 ", "(ontime turn_ms ")
    )
    texts = [trap, one_side.replace("(ontime 1000 turning -> forward))", "(ontime 1000 turning -> forward)")]
    return Edits(SCENARIO, SEED, {}, "dora", [*texts, one_side, further, by_chance], [21.5, 24.0, 38.5, 61.0])


def caught_edits() -> Edits:
    """Return a run whose edits change a distance only: it stays where the trap has it."""
    found = edits()
    trap, broken, *_ = found.texts
    texts = [trap, broken, trap.replace("[25]", "[26]"), trap.replace("[25]", "[24]"), trap]
    return replace(found, texts=texts, changes=CAUGHT_CHANGES)


def record(folder: Path) -> None:
    """Run the room with the edits, and write them with the digest of what followed."""
    found = edits()
    write(found, folder)
    write(replace(found, changes=changes_again(found, folder / "0.lrp")), folder)


if __name__ == "__main__":
    record(HERE / "reference" / "edits")
    print(changes_again(caught_edits(), TRAP))
