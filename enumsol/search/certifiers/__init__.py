"""What each arithmetic lets a search conclude."""
