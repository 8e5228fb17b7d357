"""Which modules make up the vehicle's mind. They meet in pages and nowhere else, so their order does not matter.

page "controls", "imu" ----------> heading.py (or gentle.py) --> page "turn" --.
page "controls", "imu", "depth" -> depth.py -------------------> page "lift" --+--> mixer.py --> page "pwm"
page "imu" ----------------------> telling.py -----------------> page "vehicle"
"""

from depth import DepthFactory
from gentle import GentleFactory
from heading import HeadingFactory
from mixer import MixerFactory
from telling import StatusPublisherFactory

OPTIONS = {"heading": "who keeps the heading: plain, or gentle"}


def factories(robot):
    turns = GentleFactory() if robot.options.get("heading") == "gentle" else HeadingFactory()
    return [turns, DepthFactory(), MixerFactory(), StatusPublisherFactory()]
