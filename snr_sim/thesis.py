"""The thesis' names for renamed classes and functions, and for those that snr_sim does not have.

So a program written for the 2021 library needs no more than another import. docs/coming_from_the_thesis.md has every
name of that library, and what differs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any, TypeAlias

from snr_sim.core.component import NodeComponent
from snr_sim.core.config import Config
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.factory import ComponentFactory
from snr_sim.core.loop import Loop
from snr_sim.core.node import Node
from snr_sim.core.profiler import Profiler
from snr_sim.core.runners import SynchronousRunner
from snr_sim.core.thesis_members import LoggingMembers
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.retired import Retired
from snr_sim.prelude.task import DataKey, Page, SomeTasks, Task
from snr_sim.recording.page_recorder import RecorderEndpointFactory
from snr_sim.recording.replayers import ListReplayer, ReplayerLoopFactory
from snr_sim.std_mods.moving_average import MovingAvgFilterFactory
from snr_sim.std_mods.timing import Timer
from snr_sim.supervision.multi_proc import MultiProcRunner
from snr_sim.testing.expector import Expectations, ExpectorEndpointFactory, TaskExpectations

AbstractComponent = NodeComponent
AbstractConfig = Config
AbstractContext = LoggingMembers
AbstractEndpoint = Endpoint
AbstractFactory = ComponentFactory
AbstractLoop = Loop
AbstractMultiRunner = MultiProcRunner
AbstractNode = Node
AbstractProfiler = Profiler
AbstractRunner = SynchronousRunner
ExpecterEndpointFactory = ExpectorEndpointFactory
ExpectorProtocol = Expectations
ListReplayerEndpoint = ListReplayer
ListReplayerLoop = ListReplayer
MovingAvgEndpointFactory = MovingAvgFilterFactory
NodeProtocol = Node
RecorderFactory = RecorderEndpointFactory
ReplayerFactory = ReplayerLoopFactory
TimerProtocol = Timer

ComponentName: TypeAlias = str
DataDict: TypeAlias = dict[DataKey, Page]
JsonData: TypeAlias = str | bytes
LogLevel: TypeAlias = int
OrderedExpectations: TypeAlias = TaskExpectations
ProfilerGetter: TypeAlias = Callable[[], Profiler | None]
ReloadTargets: TypeAlias = ModuleType | Sequence[ModuleType] | None
Role: TypeAlias = RoleName
TaskScheduler: TypeAlias = Callable[[SomeTasks], None]
TaskSource: TypeAlias = Callable[[], list[Task]]

_LINK = "SocketsPair((host, port)), whose client(keys) and server() are the two ends of a link."
_CONSOLE = "CommandReceiverFactory(port) alone: it carries out the commands, too."

AbstractConnection: Any = Retired("AbstractConnection", _LINK)
AbstractTaskQueue: Any = Retired("AbstractTaskQueue", "schedule(): a node's queue is its own, first in, first out.")
CommandProcessorEndpoint: Any = Retired("CommandProcessorEndpoint", _CONSOLE)
CommandProcessorFactory: Any = Retired("CommandProcessorFactory", _CONSOLE)
CommsLoop: Any = Retired("CommsLoop", _LINK)
Consumer: Any = Retired("Consumer", "a Loop, or an Endpoint that handles an event: their work is recorded.")
Context: Any = Retired("Context", "self: a component has log, rng and get_time_s() of its own.")
DummyEndpointFactory: Any = Retired(
    "DummyEndpointFactory", "FunctionEndpointFactory(handlers, name), which is in snr_sim.testing.function_components."
)
KalmanFilterFactory: Any = Retired("KalmanFilterFactory", "MovingAvgFilterFactory, or an Endpoint of your own.")
MPExpector: Any = Retired("MPExpector", "Expector: SimRunner runs all roles of a test in one process.")
RootContext: Any = Retired("RootContext", "a Node, or in a test self.mock_node().")
Serializable: Any = Retired("Serializable", "Page.serialize() and Task.serialize().")
SocketsWrapper: Any = Retired("SocketsWrapper", _LINK)
TaskPriority: Any = Retired("TaskPriority", "leave it out: terminate passes all else, which is first in, first out.")
TempFile: Any = Retired("TempFile", "self.temp_file('name') of an SNRTestCase, which returns a path.")
