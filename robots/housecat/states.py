"""The states that all of Housecat's control processes share, and what changes them."""

STATES = {
    "search": {"HEAP_SEEN": "approach", "HEAP_LOST": "done"},
    "approach": {"NEAR": "push", "HEAP_LOST": "back_up"},
    "push": {"PUSHED": "back_up", "BLOCKED": "back_up"},
    "back_up": {"CLEAR": "search"},
    "done": {"HEAP_SEEN": "approach"},
}
PROCESSES = ("process_2d", "process_3d", "driver")
