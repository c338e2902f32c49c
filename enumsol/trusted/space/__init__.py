"""The trusted core in three dimensions: sectors of slip directions, leaves, uniqueness."""
