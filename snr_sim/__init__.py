"""snr_sim: robots as SNR nodes, in lock step with simulated plants, every run recorded and replayable.

All names of the library that students use are here: `import snr_sim as snr`, or `from snr_sim import *`.
Each is imported when it is first used, so `import snr_sim` costs next to nothing.
"""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

__version__ = "0.2.0"

if TYPE_CHECKING:
    from snr_sim.console.client import ConsoleClient as ConsoleClient
    from snr_sim.console.command_receiver import CommandReceiver as CommandReceiver
    from snr_sim.console.command_receiver import CommandReceiverFactory as CommandReceiverFactory
    from snr_sim.console.local_console import LocalConsole as LocalConsole
    from snr_sim.console.local_console import LocalConsoleFactory as LocalConsoleFactory
    from snr_sim.console.remote_console import RemoteConsole as RemoteConsole
    from snr_sim.core.clocks import SimClock as SimClock
    from snr_sim.core.clocks import WallClock as WallClock
    from snr_sim.core.component import page as page
    from snr_sim.core.config import ComponentsByRole as ComponentsByRole
    from snr_sim.core.config import Config as Config
    from snr_sim.core.config import Mode as Mode
    from snr_sim.core.endpoint import Endpoint as Endpoint
    from snr_sim.core.endpoint import EndpointFactory as EndpointFactory
    from snr_sim.core.endpoint import handles as handles
    from snr_sim.core.loop import Loop as Loop
    from snr_sim.core.loop import LoopFactory as LoopFactory
    from snr_sim.core.loop import ThreadLoop as ThreadLoop
    from snr_sim.core.node import Node as Node
    from snr_sim.core.profiler import Profiler as Profiler
    from snr_sim.core.reload.watch import WatchLoopFactory as WatchLoopFactory
    from snr_sim.core.runners import CliRunner as CliRunner
    from snr_sim.core.runners import SimRunner as SimRunner
    from snr_sim.core.runners import SynchronousRunner as SynchronousRunner
    from snr_sim.core.runners import TestRunner as TestRunner
    from snr_sim.links.faults import LinkFaults as LinkFaults
    from snr_sim.links.memory import MemoryLink as MemoryLink
    from snr_sim.links.pipes import PipeLoopFactory as PipeLoopFactory
    from snr_sim.links.pipes import PipesPair as PipesPair
    from snr_sim.links.security import Tls as Tls
    from snr_sim.links.security import secret_from_env as secret_from_env
    from snr_sim.links.security import secret_from_file as secret_from_file
    from snr_sim.links.sockets import SocketsListenerFactory as SocketsListenerFactory
    from snr_sim.links.sockets import SocketsLoopFactory as SocketsLoopFactory
    from snr_sim.links.sockets import SocketsPair as SocketsPair
    from snr_sim.links.zenoh_net import ZenohNet as ZenohNet
    from snr_sim.prelude import tasks as tasks
    from snr_sim.prelude.device import Health as Health
    from snr_sim.prelude.device import PwmOut as PwmOut
    from snr_sim.prelude.device import Stale as Stale
    from snr_sim.prelude.errors import SnrError as SnrError
    from snr_sim.prelude.life_cycle import LifeCycle as LifeCycle
    from snr_sim.prelude.node_api import NodeApi as NodeApi
    from snr_sim.prelude.scenario import RobotInfo as RobotInfo
    from snr_sim.prelude.scenario import Verdict as Verdict
    from snr_sim.prelude.task import DataKey as DataKey
    from snr_sim.prelude.task import Page as Page
    from snr_sim.prelude.task import SomeTasks as SomeTasks
    from snr_sim.prelude.task import Task as Task
    from snr_sim.prelude.task import TaskHandler as TaskHandler
    from snr_sim.prelude.task import TaskHandlerMap as TaskHandlerMap
    from snr_sim.prelude.task import TaskId as TaskId
    from snr_sim.prelude.task import TaskName as TaskName
    from snr_sim.prelude.task import TaskType as TaskType
    from snr_sim.recording.page_reader import PageReader as PageReader
    from snr_sim.recording.page_reader import TextReader as TextReader
    from snr_sim.recording.page_recorder import RecorderEndpointFactory as RecorderEndpointFactory
    from snr_sim.recording.replayers import ListReplayer as ListReplayer
    from snr_sim.recording.replayers import ListReplayerFactory as ListReplayerFactory
    from snr_sim.recording.replayers import ReplayerLoop as ReplayerLoop
    from snr_sim.recording.replayers import ReplayerLoopFactory as ReplayerLoopFactory
    from snr_sim.recording.replayers import TextReplayer as TextReplayer
    from snr_sim.recording.replayers import TextReplayerFactory as TextReplayerFactory
    from snr_sim.std_mods.moving_average import MovingAvgFilter as MovingAvgFilter
    from snr_sim.std_mods.moving_average import MovingAvgFilterFactory as MovingAvgFilterFactory
    from snr_sim.std_mods.printer import PrinterEndpointFactory as PrinterEndpointFactory
    from snr_sim.std_mods.timing import StopwatchEndpointFactory as StopwatchEndpointFactory
    from snr_sim.std_mods.timing import TimeoutLoopFactory as TimeoutLoopFactory
    from snr_sim.std_mods.timing import Timer as Timer
    from snr_sim.supervision.multi_proc import MultiProcRunner as MultiProcRunner
    from snr_sim.testing.case import SNRTestCase as SNRTestCase
    from snr_sim.testing.expector import Expectations as Expectations
    from snr_sim.testing.expector import Expector as Expector
    from snr_sim.testing.expector import ExpectorEndpointFactory as ExpectorEndpointFactory
    from snr_sim.testing.expector import OrderedExpector as OrderedExpector
    from snr_sim.testing.expector import TaskExpectations as TaskExpectations
    from snr_sim.testing.fakes import FakeActuator as FakeActuator
    from snr_sim.testing.fakes import FakeSensor as FakeSensor
    from snr_sim.thesis import AbstractComponent as AbstractComponent
    from snr_sim.thesis import AbstractConfig as AbstractConfig
    from snr_sim.thesis import AbstractConnection as AbstractConnection
    from snr_sim.thesis import AbstractContext as AbstractContext
    from snr_sim.thesis import AbstractEndpoint as AbstractEndpoint
    from snr_sim.thesis import AbstractFactory as AbstractFactory
    from snr_sim.thesis import AbstractLoop as AbstractLoop
    from snr_sim.thesis import AbstractMultiRunner as AbstractMultiRunner
    from snr_sim.thesis import AbstractNode as AbstractNode
    from snr_sim.thesis import AbstractProfiler as AbstractProfiler
    from snr_sim.thesis import AbstractRunner as AbstractRunner
    from snr_sim.thesis import AbstractTaskQueue as AbstractTaskQueue
    from snr_sim.thesis import CommandProcessorEndpoint as CommandProcessorEndpoint
    from snr_sim.thesis import CommandProcessorFactory as CommandProcessorFactory
    from snr_sim.thesis import CommsLoop as CommsLoop
    from snr_sim.thesis import ComponentName as ComponentName
    from snr_sim.thesis import Consumer as Consumer
    from snr_sim.thesis import Context as Context
    from snr_sim.thesis import DataDict as DataDict
    from snr_sim.thesis import DummyEndpointFactory as DummyEndpointFactory
    from snr_sim.thesis import ExpecterEndpointFactory as ExpecterEndpointFactory
    from snr_sim.thesis import ExpectorProtocol as ExpectorProtocol
    from snr_sim.thesis import JsonData as JsonData
    from snr_sim.thesis import KalmanFilterFactory as KalmanFilterFactory
    from snr_sim.thesis import ListReplayerEndpoint as ListReplayerEndpoint
    from snr_sim.thesis import ListReplayerLoop as ListReplayerLoop
    from snr_sim.thesis import LogLevel as LogLevel
    from snr_sim.thesis import MovingAvgEndpointFactory as MovingAvgEndpointFactory
    from snr_sim.thesis import MPExpector as MPExpector
    from snr_sim.thesis import NodeProtocol as NodeProtocol
    from snr_sim.thesis import OrderedExpectations as OrderedExpectations
    from snr_sim.thesis import ProfilerGetter as ProfilerGetter
    from snr_sim.thesis import RecorderFactory as RecorderFactory
    from snr_sim.thesis import ReloadTargets as ReloadTargets
    from snr_sim.thesis import ReplayerFactory as ReplayerFactory
    from snr_sim.thesis import Role as Role
    from snr_sim.thesis import RootContext as RootContext
    from snr_sim.thesis import Serializable as Serializable
    from snr_sim.thesis import SocketsWrapper as SocketsWrapper
    from snr_sim.thesis import TaskPriority as TaskPriority
    from snr_sim.thesis import TaskScheduler as TaskScheduler
    from snr_sim.thesis import TaskSource as TaskSource
    from snr_sim.thesis import TempFile as TempFile
    from snr_sim.thesis import TimerProtocol as TimerProtocol
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__, renamed={"Faults": "LinkFaults"})
