"""The problem in two and three dimensions: data, validation, statuses, meshes, friction."""
