"""Bytes only: how what a device says is cut into frames and read. No port is opened here."""
