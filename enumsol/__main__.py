"""``python -m enumsol``: the command line."""

import sys

from enumsol.cli import main

if __name__ == "__main__":
    sys.exit(main())
