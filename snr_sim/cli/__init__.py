"""The command line: one file per verb. Each imports its dependencies when it is called, so `snr --help` is fast."""
