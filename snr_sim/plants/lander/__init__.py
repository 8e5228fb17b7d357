"""The lunar lander in one, two and three dimensions."""
