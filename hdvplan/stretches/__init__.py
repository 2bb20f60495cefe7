"""Long roads in stretches: cut, planned in turn or in parallel, and joined; memory does not grow with the road."""
