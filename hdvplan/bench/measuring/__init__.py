"""Solvers and drives measured: every planning step of a suite's cells, judged, ranked, and as tables and pictures."""
