"""Things with a wire: simulated and real, behind the same promise, and the loops that drive them."""
