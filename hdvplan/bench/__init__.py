"""Measuring planning time honestly."""

FACTOR, FLOOR_S = 1.08, 1e-6  # by which a planning step must be slower to count as a regression; steps of 12 us show the factor
ENVELOPE_M = 1e-4  # by which envelopes of one program may differ unreported
PATIENCE_S = 300.0  # for so long two programs are measured on where noise hides the answer
TIME_LIMIT_S = 600.0  # of a process of theirs, without waiting for its turns
PICTURE = "bench.png"  # of a run, in its directory
