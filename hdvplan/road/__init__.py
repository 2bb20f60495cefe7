"""Roads: reading, smoothing, the reference path and its limits."""
