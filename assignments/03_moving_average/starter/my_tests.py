"""Your tests of a moving average, as data: what goes in, and what must come out.

Each case is a dict: a length, the values that come in, and the means that must come out, one for each value.
`python3 my_tests.py` tries them on your own filter.
"""


def cases():
    """Return the list of your cases."""
    return [
        {"length": 1, "values": [5.0, 7.0], "means": [5.0, 7.0]},
        # Step 5: your cases. Which mistake would each of them find?
    ]


if __name__ == "__main__":
    from smooth import smoothed

    for case in cases():
        means = smoothed(case["values"], case["length"])
        rounded = [round(mean, 9) for mean in means]  # 0.1 + 0.2 is 0.30000000000000004
        print("right" if rounded == [round(mean, 9) for mean in case["means"]] else f"wrong: {means}", "for", case)
