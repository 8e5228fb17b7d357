"""What the trace of slow.py shows, in the yard of seed 9. Step 5 of the page has the commands."""


def answers():
    return {
        "longest_s": 0.0,  # how long the longest change of state took, from "ending" to the next "running"
        "epoch": 0,  # which epoch ended in it
        "last": "",  # which process was the last to report its end
        "together_s": 0.0,  # how long works of 0.3 s and 0.2 s can delay a change at most, next to each other
        "in_turn_s": 0.0,  # and if one program did them one after the other
        "why": "",  # one sentence of 8 to 40 words
    }
