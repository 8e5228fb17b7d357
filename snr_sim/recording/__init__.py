"""Keeps what happened: the trace is the record of truth; replay runs it again; the view shows it."""
