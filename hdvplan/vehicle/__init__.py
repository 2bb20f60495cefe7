"""Vehicles: their units, kinematics and outlines."""
