"""snr_sim: robots as SNR nodes, in lock step with simulated plants, every run recorded and replayable.

All names of the library that students use stand here: `import snr_sim as snr`, or `from snr_sim import *`.
Each is imported when it is first used, so `import snr_sim` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from snr_sim.console.client import ConsoleClient
    from snr_sim.console.command_receiver import CommandReceiver, CommandReceiverFactory
    from snr_sim.console.local_console import LocalConsole, LocalConsoleFactory
    from snr_sim.console.remote_console import RemoteConsole
    from snr_sim.core.clocks import SimClock, WallClock
    from snr_sim.core.config import ComponentsByRole, Config, Mode
    from snr_sim.core.endpoint import Endpoint, EndpointFactory
    from snr_sim.core.loop import Loop, LoopFactory, ThreadLoop
    from snr_sim.core.node import Node
    from snr_sim.core.profiler import Profiler
    from snr_sim.core.reload.watch import WatchLoopFactory
    from snr_sim.core.runners import CliRunner, SimRunner, SynchronousRunner, TestRunner
    from snr_sim.links.faults import Faults
    from snr_sim.links.memory import MemoryLink
    from snr_sim.links.pipes import PipeLoopFactory, PipesPair
    from snr_sim.links.security import Tls, secret_from_env, secret_from_file
    from snr_sim.links.sockets import SocketsListenerFactory, SocketsLoopFactory, SocketsPair
    from snr_sim.links.zenoh_net import ZenohNet
    from snr_sim.prelude import tasks
    from snr_sim.prelude.device import Health, PwmOut, Stale
    from snr_sim.prelude.errors import SnrError
    from snr_sim.prelude.life_cycle import LifeCycle
    from snr_sim.prelude.page import DataKey, Page
    from snr_sim.prelude.task import (
        SomeTasks,
        Task,
        TaskHandler,
        TaskHandlerMap,
        TaskId,
        TaskName,
        TaskType,
    )
    from snr_sim.std_mods.moving_average import MovingAvgFilter, MovingAvgFilterFactory
    from snr_sim.std_mods.printer import PrinterEndpointFactory
    from snr_sim.std_mods.readers import PageReader, TextReader
    from snr_sim.std_mods.recorder import RecorderEndpointFactory
    from snr_sim.std_mods.replayer import (
        ListReplayer,
        ListReplayerFactory,
        ReplayerLoop,
        ReplayerLoopFactory,
        TextReplayer,
        TextReplayerFactory,
    )
    from snr_sim.std_mods.stopwatch import StopwatchEndpointFactory
    from snr_sim.std_mods.timeout import TimeoutLoopFactory
    from snr_sim.std_mods.timer import Timer
    from snr_sim.supervision.multi_proc import MultiProcRunner
    from snr_sim.testing.case import SNRTestCase
    from snr_sim.testing.expector import Expectations, Expector, OrderedExpector, TaskExpectations
    from snr_sim.testing.expector_endpoint import ExpectorEndpointFactory
    from snr_sim.testing.fakes import FakeActuator, FakeSensor
    from snr_sim.thesis import (
        AbstractComponent,
        AbstractConfig,
        AbstractConnection,
        AbstractContext,
        AbstractEndpoint,
        AbstractFactory,
        AbstractLoop,
        AbstractMultiRunner,
        AbstractNode,
        AbstractProfiler,
        AbstractRunner,
        AbstractTaskQueue,
        CommandProcessorEndpoint,
        CommandProcessorFactory,
        CommsLoop,
        ComponentName,
        Consumer,
        Context,
        DataDict,
        DummyEndpointFactory,
        ExpecterEndpointFactory,
        ExpectorProtocol,
        JsonData,
        KalmanFilterFactory,
        ListReplayerEndpoint,
        ListReplayerLoop,
        LogLevel,
        MovingAvgEndpointFactory,
        MPExpector,
        NodeProtocol,
        OrderedExpectations,
        ProfilerGetter,
        RecorderFactory,
        ReloadTargets,
        ReplayerFactory,
        Role,
        RootContext,
        Serializable,
        SocketsWrapper,
        TaskPriority,
        TaskScheduler,
        TaskSource,
        TempFile,
        TimerProtocol,
    )

_PLACES = {
    "snr_sim.core.clocks": ("SimClock", "WallClock"),
    "snr_sim.core.config": ("ComponentsByRole", "Config", "Mode"),
    "snr_sim.core.endpoint": ("Endpoint", "EndpointFactory"),
    "snr_sim.core.loop": ("Loop", "LoopFactory", "ThreadLoop"),
    "snr_sim.core.node": ("Node",),
    "snr_sim.core.profiler": ("Profiler",),
    "snr_sim.core.runners": ("CliRunner", "SimRunner", "SynchronousRunner", "TestRunner"),
    "snr_sim.core.reload.watch": ("WatchLoopFactory",),
    "snr_sim.prelude.device": ("Health", "PwmOut", "Stale"),
    "snr_sim.prelude.errors": ("SnrError",),
    "snr_sim.prelude.life_cycle": ("LifeCycle",),
    "snr_sim.prelude.page": ("DataKey", "Page"),
    "snr_sim.prelude.task": (
        "SomeTasks",
        "Task",
        "TaskHandler",
        "TaskHandlerMap",
        "TaskId",
        "TaskName",
        "TaskType",
    ),
    "snr_sim.links.faults": ("Faults",),
    "snr_sim.links.memory": ("MemoryLink",),
    "snr_sim.links.pipes": ("PipeLoopFactory", "PipesPair"),
    "snr_sim.links.security": ("Tls", "secret_from_env", "secret_from_file"),
    "snr_sim.links.sockets": ("SocketsListenerFactory", "SocketsLoopFactory", "SocketsPair"),
    "snr_sim.links.zenoh_net": ("ZenohNet",),
    "snr_sim.console.client": ("ConsoleClient",),
    "snr_sim.console.command_receiver": ("CommandReceiver", "CommandReceiverFactory"),
    "snr_sim.console.local_console": ("LocalConsole", "LocalConsoleFactory"),
    "snr_sim.console.remote_console": ("RemoteConsole",),
    "snr_sim.std_mods.moving_average": ("MovingAvgFilter", "MovingAvgFilterFactory"),
    "snr_sim.std_mods.printer": ("PrinterEndpointFactory",),
    "snr_sim.std_mods.readers": ("PageReader", "TextReader"),
    "snr_sim.std_mods.recorder": ("RecorderEndpointFactory",),
    "snr_sim.std_mods.replayer": (
        "ListReplayer",
        "ListReplayerFactory",
        "ReplayerLoop",
        "ReplayerLoopFactory",
        "TextReplayer",
        "TextReplayerFactory",
    ),
    "snr_sim.std_mods.stopwatch": ("StopwatchEndpointFactory",),
    "snr_sim.std_mods.timer": ("Timer",),
    "snr_sim.std_mods.timeout": ("TimeoutLoopFactory",),
    "snr_sim.supervision.multi_proc": ("MultiProcRunner",),
    "snr_sim.testing.case": ("SNRTestCase",),
    "snr_sim.testing.expector": ("Expectations", "Expector", "OrderedExpector", "TaskExpectations"),
    "snr_sim.testing.expector_endpoint": ("ExpectorEndpointFactory",),
    "snr_sim.testing.fakes": ("FakeActuator", "FakeSensor"),
    "snr_sim.thesis": (
        "AbstractComponent",
        "AbstractConfig",
        "AbstractConnection",
        "AbstractContext",
        "AbstractEndpoint",
        "AbstractFactory",
        "AbstractLoop",
        "AbstractMultiRunner",
        "AbstractNode",
        "AbstractProfiler",
        "AbstractRunner",
        "AbstractTaskQueue",
        "CommandProcessorEndpoint",
        "CommandProcessorFactory",
        "CommsLoop",
        "ComponentName",
        "Consumer",
        "Context",
        "DataDict",
        "DummyEndpointFactory",
        "ExpecterEndpointFactory",
        "ExpectorProtocol",
        "JsonData",
        "KalmanFilterFactory",
        "ListReplayerEndpoint",
        "ListReplayerLoop",
        "LogLevel",
        "MPExpector",
        "MovingAvgEndpointFactory",
        "NodeProtocol",
        "OrderedExpectations",
        "ProfilerGetter",
        "RecorderFactory",
        "ReloadTargets",
        "ReplayerFactory",
        "Role",
        "RootContext",
        "Serializable",
        "SocketsWrapper",
        "TaskPriority",
        "TaskScheduler",
        "TaskSource",
        "TempFile",
        "TimerProtocol",
    ),
}
_HOME = {name: module for module, names in _PLACES.items() for name in names}

__all__ = [*_HOME, "tasks"]


def __getattr__(name: str) -> Any:
    if name == "tasks":
        value: Any = import_module("snr_sim.prelude.tasks")
    elif name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
    else:
        raise AttributeError(f"module 'snr_sim' has no attribute '{name}'")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
