"""The grader: what a submission is worth, found out in a way that it cannot change."""
