"""The published experiments again: each study's numbers beside the published ones, its figure and its data."""
