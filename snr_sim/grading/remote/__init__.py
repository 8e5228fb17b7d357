"""A submission in a process of its own, and what the grader exchanges with it."""
