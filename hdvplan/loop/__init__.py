"""A path in a closed loop: followed by a driver or a controller that sees late and inexactly, and judged by what was driven."""
