"""Expects what its author would like."""


def cases():
    return [
        {"length": 2, "values": [1.0, 2.0, 4.0, 4.0], "means": [1.0, 1.5, 3.0, 4.0]},
        {"length": 3, "values": [3.0, 0.0, 6.0, 9.0], "means": [1.0, 1.0, 3.0, 5.0]},
        {"length": 4, "values": [8.0, 0.0], "means": [8.0, 4.0]},
        {"length": 1, "values": [5.0, -7.0], "means": [5.0, -7.0]},
    ]
