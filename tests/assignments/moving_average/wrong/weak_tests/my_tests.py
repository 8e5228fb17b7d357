"""Nothing in here ever leaves a window."""


def cases():
    return [
        {"length": 3, "values": [2.0, 2.0, 2.0], "means": [2.0, 2.0, 2.0]},
        {"length": 2, "values": [1.0], "means": [1.0]},
        {"length": 5, "values": [4.0, 4.0], "means": [4.0, 4.0]},
        {"length": 1, "values": [0.0], "means": [0.0]},
    ]
