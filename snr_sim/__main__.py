"""`python -m snr_sim` is `snr`."""

from snr_sim.cli.entry import main

main()
