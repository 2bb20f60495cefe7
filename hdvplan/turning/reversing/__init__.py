"""Manoeuvres of forward and backward legs: three-point turns, turning heads and docks."""
