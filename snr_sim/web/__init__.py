"""Pages in a browser: the live page of the state machines of a running node, or of a recorded run.

LiveLoopFactory --> LiveLoop --> Starlette on uvicorn --> WebSocket: messages.py --> page in static/
"""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.web.live import LiveLoopFactory as LiveLoopFactory
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
