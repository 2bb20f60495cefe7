"""Driving: plan, execute a few metres as an exact simulation, plan again."""
