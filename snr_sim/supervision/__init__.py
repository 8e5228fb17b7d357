"""Processes of a robot: started together, watched, ended in order."""
