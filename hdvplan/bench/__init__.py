"""Measuring planning time honestly."""

PICTURE = "bench.png"  # of a run, in its directory
