"""Microcontroller boards on a serial line: pulses, battery, watchdog."""
