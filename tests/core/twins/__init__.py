"""What the core computes, written once more in plain Python: the oracles of its functions."""
