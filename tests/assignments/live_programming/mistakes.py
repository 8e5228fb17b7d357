"""Wrong solutions of the lab "live programming", their lost points and their hints."""

from pathlib import Path

from tests.assignments.mistakes import Mistake, remove, replace, write

FLAT = """\
(def distance [robot.ultra.read()])
(machine dora
  (event stop)
  (event go)
  (var turn_ms := [3000])
  (state waiting (onentry [robot.stop()]))
  (state forward (onentry [
    robot.motor_a.start(12)
    robot.motor_d.start(12)]))
  (state turning (onentry [
    turn_ms = 1500 + int(random() * 3500)
    robot.motor_a.start(-7)
    robot.motor_d.start(7)]))
  (state stopped (onentry [robot.stop()]))
  (on stop * -> stopped)
  (on go stopped -> waiting)
  (on [distance() is None] * -> waiting)
  (on [distance() is not None] waiting -> forward)
  (on [distance() < 28] forward -> turning)
  (on [robot.left_touch.read() == 1 or robot.right_touch.read() == 1] forward -> turning)
  (ontime turn_ms turning -> forward))
(spawn dora waiting)
"""
NO_PROGRAM = {"is_program": 5.0, "has_no_dead_end": 10.0, "stops": 15.0, "stands_without_readings": 10.0}
UNSEEN = "      (on [distance() is None] * -> waiting)\n"
WALL = "(event wall [distance() is not None and distance() < near_cm])"
TURN = """\
        side = 1 if random() < 0.5 else -1
        turn_ms = 1500 + int(random() * 3500)
"""
AT_S = "at_s = [21.5, 24.0, 38.5, 61.0]"


def save_again(folder: Path) -> None:
    """Have each edit be the first program."""
    text = (folder / "edits" / "0.lrp").read_text()
    for number in range(1, 5):
        (folder / "edits" / f"{number}.lrp").write_text(text + number * "\n")


MISTAKES = {
    "broken_bracket": Mistake(
        "Hands in the text of a moment at which a bracket was missing.",
        lost=NO_PROGRAM,
        hint="shows every mistake with its line",
        changes=[replace("dora.lrp", "(spawn dora driving)", "(spawn dora driving")],
    ),
    "two_files": Mistake(
        "Takes a function of a Python file, which is not handed in.",
        lost=NO_PROGRAM,
        hint="Hand in one file",
        changes=[
            replace("dora.lrp", "(machine dora\n", '(actions "moves.py")\n(machine dora\n'),
            write("moves.py", "raise SystemExit\n"),
        ],
    ),
    "wrong_part": Mistake(
        "Names a part that Dora does not have.",
        lost=NO_PROGRAM,
        hint="ultra",
        changes=[replace("dora.lrp", "robot.ultra.read()", "robot.sonar.read()")],
    ),
    "gives_up": Mistake(
        "Gives up after four minutes, in a state that nothing leaves.",
        lost={"has_no_dead_end": 10.0},
        hint="State 'tired' cannot be left",
        changes=[
            replace(
                "dora.lrp",
                "  (state stopped (onentry [robot.stop()]))\n  (on stop driving -> stopped)\n",
                "  (state stopped (onentry [robot.stop()]))\n  (state tired (onentry [robot.stop()]))\n"
                "  (on stop driving -> stopped)\n  (ontime 240000 driving -> tired)\n",
            )
        ],
    ),
    "forgotten_state": Mistake(
        "Has a state that nothing leads to.",
        lost={"has_no_dead_end": 10.0},
        hint="No run can reach state 'backing'",
        changes=[replace("dora.lrp", "(on bump forward -> backing)", "(on bump forward -> turning)")],
    ),
    "stops_in_one_state": Mistake(
        "Stops only while it drives forward.",
        lost={"stops": 7.5},
        hint="in whatever state it is",
        changes=[
            replace("dora.lrp", "  (on stop driving -> stopped)\n", ""),
            replace("dora.lrp", UNSEEN, f"{UNSEEN}      (exit stop forward -> stopped)\n"),
        ],
    ),
    "wildcard_out_of_stop": Mistake(
        "Leads from every state to `waiting` when it sees nothing, also out of the stop.",
        lost={"stops": 15.0},
        hint="drove again without the event `go`",
        changes=[write("dora.lrp", FLAT)],
    ),
    "no_go": Mistake(
        "Stays stopped, also after `go`.",
        lost={"stops": 15.0},
        hint="After the event `go` it must drive on",
        changes=[replace("dora.lrp", "(on go stopped -> driving)", "(on go driving -> stopped)")],
    ),
    "drives_without_readings": Mistake(
        "Drives on without readings.",
        lost={"stands_without_readings": 10.0},
        hint="read() is None then",
        changes=[replace("dora.lrp", UNSEEN, "")],
    ),
    "compares_none": Mistake(
        "Compares None with a distance before it looks whether there is one.",
        lost={"stands_without_readings": 10.0},
        hint="A block has failed",
        changes=[
            replace("dora.lrp", UNSEEN, ""),
            replace("dora.lrp", WALL, "(event wall [distance() < near_cm])"),
            replace("dora.lrp", "      (ontime 1000 backing", f"{UNSEEN}      (ontime 1000 backing"),
        ],
    ),
    "two_edits": Mistake(
        "Edits its run twice only.",
        lost={"edited_in_flight": 10.0, "replays": 15.0},
        hint="Go in small steps",
        changes=[replace("edits/edits.toml", AT_S, "at_s = [21.5, 24.0]"), remove("edits/4.lrp")],
    ),
    "same_text_again": Mistake(
        "Saves the same program again and again, each time with one more empty line.",
        lost={"edited_in_flight": 10.0, "replays": 15.0},
        hint="Go in small steps",
        changes=[save_again],
    ),
    "another_beginning": Mistake(
        "Begins its run with a program that was changed before.",
        lost={"edited_in_flight": 10.0, "replays": 15.0},
        hint="Begin the run with a copy of trap.lrp",
        changes=[replace("edits/0.lrp", "side = -side", "side = 1")],
    ),
    "another_room": Mistake(
        "Hands in the edits of a run in another room.",
        lost={"edited_in_flight": 10.0, "replays": 15.0},
        hint="dora_corners with seed 0",
        changes=[replace("edits/edits.toml", "seed = 0", "seed = 3")],
    ),
    "broken_edits": Mistake(
        "Saves two programs and two texts with mistakes.",
        lost={"replays": 15.0},
        hint="A text with mistakes changes nothing",
        changes=[replace("edits/3.lrp", "(spawn dora waiting)", "(spawn dora waiting")],
    ),
    "forged_digest": Mistake(
        "Claims a digest that it has not seen.",
        lost={"replays": 15.0},
        hint="the states change differently",
        changes=[replace("edits/edits.toml", 'changes = "', 'changes = "0')],
    ),
    "polished_edit": Mistake(
        "Improves an edit after the run.",
        lost={"replays": 15.0},
        hint="the states change differently",
        changes=[replace("edits/3.lrp", "(ontime 2500 ", "(ontime 2600 ")],
    ),
    "caught": Mistake(
        "Turns to one side and then to the other, always as far.",
        lost={"explores": 25.0, "explores_late": 10.0},
        hint="is it caught somewhere",
        changes=[replace("dora.lrp", TURN, "        side = -side\n        turn_ms = 900\n")],
    ),
    "late": Mistake(
        "Turns away from a wall so late that it is right on the robot itself only.",
        lost={"explores_late": 10.0},
        hint="Over a slow line it hit something",
        changes=[
            replace("dora.lrp", "(var speed := [12])", "(var speed := [60])"),
            replace("dora.lrp", "(var near_cm := [28])", "(var near_cm := [20])"),
        ],
    ),
    "fast_at_its_sides": Mistake(
        "Drives so fast that what the sensor does not see is hit hard.",
        lost={"explores": 25.0, "explores_late": 10.0},
        hint="what does the cone of the sensor not see",
        changes=[
            replace("dora.lrp", "(var speed := [12])", "(var speed := [75])"),
            replace("dora.lrp", "(var near_cm := [28])", "(var near_cm := [14])"),
        ],
    ),
}
