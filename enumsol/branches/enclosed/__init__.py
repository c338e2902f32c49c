"""The graph from arcs enclosed in balls."""
