"""Benchmarks are no tests: `snr bench` runs them, pytest leaves them alone."""

collect_ignore_glob = ["*.py"]
