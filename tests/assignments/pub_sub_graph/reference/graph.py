"""Which modules make up the vehicle's mind. They meet in pages and nowhere else, so their order does not matter.

page "controls", "imu" ----------> heading.py (or gentle.py) --> page "turn" --.
page "controls", "imu", "depth" -> depth.py -------------------> page "lift" --+--> mixer.py --> page "pwm"
page "imu" ----------------------> telling.py -----------------> page "vehicle"
"""

from depth import DepthHold
from gentle import Gentle
from heading import Heading
from mixer import Mixer
from telling import StatusPublisher

OPTIONS = {"heading": "who keeps the heading: plain, or gentle"}


def factories(robot):
    turns = Gentle if robot.options.get("heading") == "gentle" else Heading
    return [turns.factory("heading"), DepthHold.factory(), Mixer.factory(), StatusPublisher.factory()]
