"""Emulated microcontrollers in simavr, running the firmware that is flashed into real ones.

simavr is under the GPL, so nothing compiled with it ships. `board.c` ships as source and is compiled on the machine
that uses it, when it is first used, with the packages of Debian that `toolchain.py` names.
"""
