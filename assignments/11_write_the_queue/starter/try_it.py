"""Puts your queue into a real node and shows what it does: python try_it.py

Do not change it; it is not graded.
"""

import sys
from pathlib import Path

from snr_sim.grading.lab.lab import find_lab
from snr_sim.prelude.errors import SnrError
from snr_sim.scenario.library import load_program

MAX_TASKS = 5
FIRST = [["event", "tick"], ["process_data", "depth"], ["event", "tock"], ["event", "late"]]
ANSWERS = {
    "tick": [["event", "light"], ["process_data", "imu"], ["event", "dark"]],
    "depth": [["event", "push"]],
    "imu": [["event", "turn"], ["process_data", "power"]],
    "light": [["terminate", "enough"], ["event", "never"]],
}
RIGHT = {  # what a node does whose queue is right
    "handled": ["depth", "tick", "imu", "power", "push", "light", "enough", "dark", "turn", "never"],
    "dropped": ["tock", "late"],
}


def main():
    """Runs the node with your queue, and shows what one with a right queue does."""
    bench = find_lab("write_the_queue").module("grader.queue_bench")
    yours = bench.QueueBench(load_program(str(Path(__file__).parent / "task_queue.py")))
    for name, done in (("yours", yours.run_node(MAX_TASKS, ANSWERS, FIRST)), ("right", RIGHT)):
        print(f"{name:6s} handled {' '.join(done['handled'])}")
        print(f"       dropped {' '.join(done['dropped']) or '-'}")
    for size in (40, 240):
        steps = [["put", "event", f"e{i}", i * 7919 % 1000] for i in range(size)]
        steps += [["take"] if i % 2 else ["put", "event", f"f{i}", i * 7907 % 1000] for i in range(size)]
        print(f"with {size:3d} tasks one operation is {yours.work(size, steps):6.1f} comparisons and moves")


if __name__ == "__main__":
    try:
        main()
    except SnrError as error:
        sys.exit(f"Error: {error}")
