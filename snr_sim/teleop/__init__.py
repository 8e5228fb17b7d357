"""Teleoperation: a person, or a script in their place, commands a robot over a link and sees what it does.

    ManualInput --> page "pad" --> GamepadPilot --.
    ScriptedPilot --------------------------------+--> page "controls" ==link==> robot
    Display, LinkMonitor <-------------------------------- page "vehicle" <==link==' `--> sensors' pages

A robot gives the struct of its controls (with `number`, `mode`, `is_armed`, `is_stop`, `clears_stop`, and one field for
each stick), and its page "vehicle" contains at least whether it `is_stopped`.
"""
