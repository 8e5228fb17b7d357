"""Console: commands to a running node, typed by a user or sent by a program."""
