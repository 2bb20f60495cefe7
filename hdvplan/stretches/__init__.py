"""Long roads in stretches: cut, planned one by one or side by side, and joined; memory does not grow with the road."""
