"""Two programs compared: both are made ready, measured in turn, and decided about."""
