"""On which side to pass every obstacle."""
