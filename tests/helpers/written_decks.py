"""Decks written for a test, and their descriptions."""

from enumsol.decks.reading import described

#: Four nodes and a square of plane stress.
SQUARE = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT,TYPE=CPS4,ELSET=BODY\n1,1,2,3,4\n"


def written(folder, text, files=()):
    """Path of a deck in a folder, with other files beside it."""
    for name, content in {**dict(files), "model.inp": text}.items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / "model.inp"


def read(folder, text, files=(), **options):
    """Description of a deck that is written into a folder."""
    return described(written(folder, text, files), **options)


def labels(deck, rows):
    """Numbers of nodes in the deck, in order."""
    return sorted(deck.node_labels[rows].tolist())


def unused(deck):
    """Lines of the account on what is not used."""
    return [f"line {entry.place.line}: *{entry.card} {entry.became}" for entry in deck.account if not entry.used]
