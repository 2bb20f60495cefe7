"""Judging what was planned: exact simulation, swept envelope, balance."""
