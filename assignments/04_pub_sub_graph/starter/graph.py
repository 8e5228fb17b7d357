"""Which modules make up the vehicle's mind.

Step 1 of the README: put the factories in another order, and fly again.
"""

from depth import DepthFactory
from heading import HeadingFactory
from mixer import MixerFactory
from telling import StatusPublisherFactory

OPTIONS = {"heading": "who keeps the heading: plain, or gentle"}


def factories(robot):
    return [MixerFactory(), HeadingFactory(), DepthFactory(), StatusPublisherFactory()]
