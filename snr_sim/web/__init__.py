"""Pages in a browser: the live page of the state machines of a running node, or of a recorded run; and rosbridge.

LiveLoopFactory --> LiveLoop --> Starlette on uvicorn --> WebSocket: messages.py --> page in static/
RosbridgeFactory --> RosbridgeLoop --> the same server --> WebSocket: rosbridge.py --> tools of ROS
"""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.web.live import LiveLoopFactory as LiveLoopFactory
    from snr_sim.web.rosbridge import RosbridgeFactory as RosbridgeFactory
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
