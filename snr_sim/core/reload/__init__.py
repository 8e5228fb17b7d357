"""Change a running node: reload a component from its source, try it, and put back the old one."""
