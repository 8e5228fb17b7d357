"""Parts of a lab: checks, scenario runs, verdicts."""
