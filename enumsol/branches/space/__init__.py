"""Branch graphs in 3D: curves of solutions in boxes, and what they are joined to (theory, section 12.8)."""
