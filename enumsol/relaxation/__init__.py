"""The convex relaxation of a partial assignment, and the engines that solve it."""
