"""Results as they are handed out."""
