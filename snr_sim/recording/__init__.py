"""Recording of runs: the trace is the complete record, replay executes it again, and the view displays it."""
