"""Asks whoever sits at the terminal; there should be nobody."""


def double(x):
    return int(input("What is twice " + str(x) + "?"))
