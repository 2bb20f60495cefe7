"""A planner as C files: for a vehicle's own computer, without Python, without allocation, with a budget."""
