"""What a submission is kept in."""
