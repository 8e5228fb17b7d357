"""`python -m snr_sim` is `snr`."""

from snr_sim.cli.main import main

main()
