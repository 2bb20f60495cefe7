"""Routes of a map as roads: what OpenStreetMap calls a route, stitched from its ways."""
