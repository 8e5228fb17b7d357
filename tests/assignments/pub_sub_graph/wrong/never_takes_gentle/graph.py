"""Which modules make up the vehicle's mind. Wrong: --option heading=gentle changes nothing."""

from depth import DepthFactory
from heading import HeadingFactory
from mixer import MixerFactory
from telling import TellingFactory

OPTIONS = {"heading": "who keeps the heading: plain, or gentle"}


def factories(robot):
    return [HeadingFactory(), DepthFactory(), MixerFactory(), TellingFactory()]
