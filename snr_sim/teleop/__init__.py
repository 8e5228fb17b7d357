"""Teleoperation: a person, or a script in their place, commands a robot over a link and sees what it does.

    ManualInput --> page "gamepad" --> GamepadPilot --.
    ScriptedPilot --------------------------------+--> page "controls" ==link==> robot
    Display, LinkMonitor <-------------------------------- page "vehicle" <==link==' `--> sensors' pages

A robot gives the struct of its controls (with `number`, `mode`, `is_armed`, `is_stop`, `clears_stop`, and one field for
each stick), and its page "vehicle" contains at least whether it `is_stopped`.
"""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.teleop.button_panel import ButtonPanelFactory as ButtonPanelFactory
    from snr_sim.teleop.button_panel import presses_of as presses_of
    from snr_sim.teleop.display import DisplayFactory as DisplayFactory
    from snr_sim.teleop.display import Rows as Rows
    from snr_sim.teleop.gamepad_pilot import GamepadPilotFactory as GamepadPilotFactory
    from snr_sim.teleop.gamepad_pilot import Stick as Stick
    from snr_sim.teleop.keyboard import Keyboard as Keyboard
    from snr_sim.teleop.keyboard import legend as legend
    from snr_sim.teleop.link_monitor import LinkMonitorFactory as LinkMonitorFactory
    from snr_sim.teleop.link_options import surface_link as surface_link
    from snr_sim.teleop.manual_input import DeadmanSwitch as DeadmanSwitch
    from snr_sim.teleop.manual_input import ManualInput as ManualInput
    from snr_sim.teleop.pilot_commands import NewestControls as NewestControls
    from snr_sim.teleop.pilot_commands import pilot_of as pilot_of
    from snr_sim.teleop.pilot_commands import read_controls as read_controls
    from snr_sim.teleop.scripted_pilot import Cue as Cue
    from snr_sim.teleop.scripted_pilot import ScriptedPilotFactory as ScriptedPilotFactory
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
