"""Certifiers: conclusions that each arithmetic allows a search."""
