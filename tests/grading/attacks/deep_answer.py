"""Answers with lists in lists in lists, as deep as it can."""


def double(x):
    answer = []
    for _ in range(100_000):
        answer = [answer]
    return answer
