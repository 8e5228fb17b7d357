"""What runs: the event machine, its door, the components on it, the clocks and the runners."""
