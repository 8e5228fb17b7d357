"""Which modules make up the vehicle's mind.

Step 1 of the README: put the factories in another order, and fly again.
"""

from depth import DepthHold
from heading import Heading
from mixer import Mixer
from telling import StatusPublisher

OPTIONS = {"heading": "who keeps the heading: plain, or gentle"}


def factories(robot):
    return [Mixer.factory(), Heading.factory(), DepthHold.factory(), StatusPublisher.factory()]
