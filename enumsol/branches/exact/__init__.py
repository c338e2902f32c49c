"""The graph from exact algebra in alpha."""
