"""Prescribed manoeuvres: a point of the vehicle follows a given path exactly, and what the vehicle sweeps meanwhile."""
