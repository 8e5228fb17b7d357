"""What a lab is made of: checks, scenario runs, verdicts."""
