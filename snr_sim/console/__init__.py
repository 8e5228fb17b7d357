"""The console: commands typed by a person, or sent by a program, to a node that runs."""
