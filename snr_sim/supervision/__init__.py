"""Processes of a robot: started together, monitored, and shut down gracefully."""
