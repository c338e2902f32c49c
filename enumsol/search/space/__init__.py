"""The search in three dimensions."""
