"""Judging: what an executed drive swept, and whether it kept what it had to keep."""
