"""PWM outputs: backends, their supervisor, and the loops that drive them."""
