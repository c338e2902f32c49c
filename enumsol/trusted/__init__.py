"""What search and checker both trust: rows of a status, exclusions, verified selections."""
