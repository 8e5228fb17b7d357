"""Excludes the benchmarks from pytest: `snr bench` runs them."""

collect_ignore_glob = ["*.py"]
