"""Loops in separate processes: how they are started, and the messages between them and their node."""
