"""Prepare, run and record a scenario, a program or a role."""
