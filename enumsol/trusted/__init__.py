"""Tests that search and checker both trust: rows of a status, exclusions, verified selections."""
