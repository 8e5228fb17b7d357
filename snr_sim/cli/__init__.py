"""The command line: one file per verb. Each imports what it needs when it is called, so that `snr --help` is quick."""
