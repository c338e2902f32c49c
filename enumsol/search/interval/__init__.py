"""The search over an interval of alpha."""
