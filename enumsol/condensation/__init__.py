"""A problem condensed to its contact nodes: in floats, as balls, in rationals."""
