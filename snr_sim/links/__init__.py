"""Links: transfer of pages between nodes."""
