"""Solving one complete selection, in one file for each arithmetic."""
