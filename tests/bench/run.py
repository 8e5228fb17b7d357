"""Runs one benchmark, as `snr bench` does: python tests/bench/run.py NAME [--quick]. Prints lines of JSON."""

from harness import main

if __name__ == "__main__":
    main()
