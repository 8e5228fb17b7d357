"""Recording of runs: traces and their replay; components that record pages and store recorded ones again."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.prelude.values import decode_value as decode_value
    from snr_sim.prelude.values import encode_value as encode_value
    from snr_sim.recording.compare_signals import signals_of as signals_of
    from snr_sim.recording.folder import trace_path as trace_path
    from snr_sim.recording.page_reader import PageReader as PageReader
    from snr_sim.recording.page_reader import TextReader as TextReader
    from snr_sim.recording.page_recorder import RecorderEndpointFactory as RecorderEndpointFactory
    from snr_sim.recording.reader import Trace as Trace
    from snr_sim.recording.reader import read_trace as read_trace
    from snr_sim.recording.records import BeginRecord as BeginRecord
    from snr_sim.recording.records import EndRecord as EndRecord
    from snr_sim.recording.records import ErrorRecord as ErrorRecord
    from snr_sim.recording.records import HandlerCall as HandlerCall
    from snr_sim.recording.records import Header as Header
    from snr_sim.recording.records import InputRecord as InputRecord
    from snr_sim.recording.records import LogLineRecord as LogLineRecord
    from snr_sim.recording.records import PageRecord as PageRecord
    from snr_sim.recording.records import ReturnedTask as ReturnedTask
    from snr_sim.recording.records import TaskRecord as TaskRecord
    from snr_sim.recording.records import TraceInfo as TraceInfo
    from snr_sim.recording.records import TruthRecord as TruthRecord
    from snr_sim.recording.replay import replay_node as replay_node
    from snr_sim.recording.replayers import ListReplayer as ListReplayer
    from snr_sim.recording.replayers import ListReplayerFactory as ListReplayerFactory
    from snr_sim.recording.replayers import ReplayerLoop as ReplayerLoop
    from snr_sim.recording.replayers import ReplayerLoopFactory as ReplayerLoopFactory
    from snr_sim.recording.replayers import TextReplayer as TextReplayer
    from snr_sim.recording.replayers import TextReplayerFactory as TextReplayerFactory
    from snr_sim.view.view import write_view as write_view
else:
    # `compare_runs` is missing: the name is taken by the module that it is in.
    __all__, __getattr__, __dir__ = lazy_names(__name__)
