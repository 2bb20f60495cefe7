"""QP solvers behind one small protocol."""
