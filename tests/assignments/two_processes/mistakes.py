"""Wrong solutions of the lab "two processes", their lost points and their hints."""

from tests.assignments.mistakes import Change, Mistake, replace, write

RUNS = {"clears_by_stereo": 10.0, "clears_by_lidar": 10.0, "slow_and_explained": 15.0}
ALL = {
    "own_process": 5.0,
    "finds": 15.0,
    "follows_states": 20.0,
    "all_together": 10.0,
    "events_once": 10.0,
    "one_line": 5.0,
    **RUNS,
}
OBSERVERS = 'observers=["process_2d", "process_3d", "driver"]'


def without_process_2d(file: str) -> Change:
    """Return a change that leaves the student's process out of the barrier."""
    return replace(file, OBSERVERS, 'observers=["process_3d", "driver"]')


MISTAKES = {
    "the_robots_own": Mistake(
        "Imports the robot's own Process_2D instead of writing one.",
        lost=ALL,
        hint="snr_sim_robot_housecat.process_2d.PROCESS_2D' is not among what the README lists",
        changes=[write("process_2d.py", "from snr_sim_robot_housecat.process_2d import PROCESS_2D\n")],
    ),
    "the_robots_own_by_another": Mistake(
        "Takes the robot's own Process_2D from a module that imports it.",
        lost=ALL,
        hint="snr_sim_robot_housecat.controllers.clearer' is not among what the README lists",
        changes=[
            replace(
                "stereo.py",
                "from process_2d import PROCESS_2D\n",
                "from snr_sim_robot_housecat.controllers import clearer\n\nPROCESS_2D = clearer.PROCESS_2D\n",
            )
        ],
    ),
    "the_robots_own_by_a_file": Mistake(
        "Takes the robot's own Process_2D from a file that is called like a module of Python's.",
        lost=ALL,
        hint="is called like the module 'statistics'",
        changes=[
            write("statistics.py", "from snr_sim_robot_housecat.process_2d import PROCESS_2D as STATES_2D\n"),
            write("process_2d.py", "from statistics import STATES_2D as PROCESS_2D\n"),
        ],
    ),
    "wrong_sign": Mistake(
        "Counts the bearing to the right.",
        lost={"finds": 15.0, **RUNS},
        hint="The bearing has the wrong sign",
        changes=[replace("process_2d.py", "return float(-math.atan(", "return float(math.atan(")],
    ),
    "posts": Mistake(
        "Takes the posts for stones.",
        lost={"finds": 5.0, "follows_states": 20.0},
        hint="Every other image shows no stones",
        changes=[replace("process_2d.py", "RED_PER_BLUE = 2.25", "RED_PER_BLUE = 1.9")],
    ),
    "mean_of_all": Mistake(
        "Takes the mean of all pixels of stones instead of the nearest.",
        lost={"finds": 5.0, "slow_and_explained": 15.0},
        hint="The nearest stones count",
        changes=[
            replace("process_2d.py", "column, width = near[len(near) // 2], ", "column, width = columns.mean(), "),
        ],
    ),
    "old_image": Mistake(
        "Looks at an image from before the state began.",
        lost={"finds": 15.0, "follows_states": 5.0, "slow_and_explained": 6.0},
        hint="An image from before the state began does not count",
        changes=[replace("process_2d.py", "self.stamp_s = self.entered_s\n", "self.stamp_s = -1.0\n")],
    ),
    "looks_at_all_times": Mistake(
        "Looks in the states in which the blade hides the stones, too.",
        lost={"follows_states": 5.0},
        hint="it must neither look nor send an event",
        changes=[replace("process_2d.py", '"push": Idle, "back_up": Idle', '"push": Approach, "back_up": Approach')],
    ),
    "impatient": Mistake(
        "Reports lost stones after one second.",
        lost={"follows_states": 15.0},
        hint="counted from the last that did, and not before",
        changes=[replace("process_2d.py", "LOST_S = 1.5", "LOST_S = 1.0")],
    ),
    "as_patient_as_the_robots_own": Mistake(
        "Reports lost stones after two seconds, as the robot's own Process_2D does.",
        lost={"follows_states": 15.0},
        hint="counted from the last that did, and not before",
        changes=[replace("process_2d.py", "LOST_S = 1.5", "LOST_S = 2.0")],
    ),
    "one_time_for_all_states": Mistake(
        "Keeps the time of the last stones for all states, in the class.",
        lost={"follows_states": 10.0},
        hint="Each time a state is entered its time starts again",
        changes=[
            replace("process_2d.py", "        self.seen_s = self.entered_s\n", ""),
            replace(
                "process_2d.py",
                "        self.seen_s = self.get_time_s()\n",
                "        Look.seen_s = self.get_time_s()\n",
            ),
            replace(
                "process_2d.py", '    """Base of the states that look."""\n', '    """Base."""\n\n    seen_s = 0.0\n'
            ),
        ],
    ),
    "past_the_queue": Mistake(
        "Sends events that count in any state, past the queue of the reference machine.",
        lost={"all_together": 10.0, "events_once": 10.0, **RUNS},
        hint="was sent without the epoch in which it is true",
        changes=[
            replace(
                "process_2d.py",
                '    """Base of the states that look."""\n',
                '''\
    """Base."""

    def publish_event(self, name):
        self.parent.schedule(tasks.event(name))
''',
            ),
            replace("process_2d.py", "import numpy as np\n", "import numpy as np\n\nfrom snr_sim import tasks\n"),
        ],
    ),
    "left_out": Mistake(
        "Leaves process_2d out of those that the reference machine waits for.",
        lost={"finds": 15.0, "follows_states": 20.0, "all_together": 10.0, "events_once": 10.0, **RUNS},
        hint="process_2d published too few events to be judged",
        changes=[without_process_2d(file) for file in ("stereo.py", "lidar.py", "slow.py")],
    ),
    "not_in_the_barrier": Mistake(
        "Makes process_2d an endpoint, which no barrier holds.",
        lost={"finds": 5.0, "follows_states": 20.0, "all_together": 10.0, **RUNS},
        hint="Name all three processes in observers",
        changes=[
            replace(
                "process_2d.py",
                "PROCESS_2D = {",
                '''\
class Eye(Endpoint):
    """Looks at each image."""

    @handles("mono")
    def on_mono(self, mono):
        """Send an event past every state."""
        bearing_rad = find_stones(mono["rgb"], mono["field_of_view_rad"])
        epoch = self.get_data("reference")["epoch"]
        if bearing_rad is None:
            return tasks.event("reference.publish", ["HEAP_LOST", self.name, epoch])
        heap = {"bearing_rad": bearing_rad, "stamp_s": mono["stamp_s"]}
        seen = tasks.event("reference.publish", ["HEAP_SEEN", self.name, epoch])
        return [self.store_data_task("heap_2d", heap), seen]


PROCESS_2D = {''',
            ),
            replace(
                "process_2d.py",
                "import numpy as np\n",
                "import numpy as np\n\nfrom snr_sim import Endpoint, handles, tasks\n",
            ),
            *[
                change
                for file in ("stereo.py", "lidar.py")
                for change in (
                    without_process_2d(file),
                    replace(file, "from process_2d import PROCESS_2D", "from process_2d import Eye"),
                    replace(
                        file,
                        'ControlProcessFactory("process_2d", of="reference", states=PROCESS_2D, rate_hz=20.0)',
                        'Eye.factory(name="process_2d")',
                    ),
                )
            ],
            without_process_2d("slow.py"),
        ],
    ),
    "two_lines": Mistake(
        "Changes another line together with the sensor.",
        lost={"one_line": 5.0},
        hint="Other sensors are other states of Process_3D, and nothing else changes",
        changes=[replace("lidar.py", "states=DRIVER, rate_hz=20.0", "states=DRIVER, rate_hz=25.0")],
    ),
    "no_swap": Mistake(
        "Leaves lidar.py as a copy of stereo.py.",
        lost={"one_line": 5.0, "clears_by_lidar": 10.0},
        hint="lidar.py is still stereo.py",
        changes=[replace("lidar.py", 'PROCESS_3D["lidar"]', 'PROCESS_3D["stereo"]')],
    ),
    "the_sum": Mistake(
        "Answers that a change waits for the sum of the works.",
        lost={"slow_and_explained": 3.0},
        hint="works that run next to each other, and one after the other",
        changes=[replace("answers.py", '"together_s": 0.3', '"together_s": 0.5')],
    ),
}
