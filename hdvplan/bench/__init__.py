"""Measuring planning time honestly."""
