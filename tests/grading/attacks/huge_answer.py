"""Answers with a text of 200 MB, and with a number of a million digits."""


def double(x):
    return "2" * (200 * 2**20) if x == 1 else 10**1_000_000
