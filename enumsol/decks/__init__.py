"""Decks of CalculiX and Abaqus (`.inp`) as plain descriptions, which know nothing of contact problems.

Lines become cards (`cards`), a small function for each kind of card puts it into a `Deck` (`model`, `registry`, and the
modules whose names end in `_cards`), and `reading` goes through all of a file.
"""
