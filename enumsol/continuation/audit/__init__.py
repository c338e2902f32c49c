"""Paths compared with a branch graph: every point placed on it, and what the path missed."""
