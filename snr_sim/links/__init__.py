"""Links: transfer of pages between nodes."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.links.faults import LinkFaults as LinkFaults
    from snr_sim.links.memory import MemoryLink as MemoryLink
    from snr_sim.links.options import LinkOptions as LinkOptions
    from snr_sim.links.pipes import PipeLoopFactory as PipeLoopFactory
    from snr_sim.links.pipes import PipesPair as PipesPair
    from snr_sim.links.security import Tls as Tls
    from snr_sim.links.security import secret_from_env as secret_from_env
    from snr_sim.links.security import secret_from_file as secret_from_file
    from snr_sim.links.sockets import SocketsListenerFactory as SocketsListenerFactory
    from snr_sim.links.sockets import SocketsLoopFactory as SocketsLoopFactory
    from snr_sim.links.sockets import SocketsPair as SocketsPair
    from snr_sim.links.zenoh_net import ZenohNet as ZenohNet
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
