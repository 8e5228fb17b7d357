"""Asks for input at the terminal; there should not be one."""


def double(x):
    return int(input("What is twice " + str(x) + "?"))
