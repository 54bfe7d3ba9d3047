"""``python -m wholebody``: the same as the command `wholebody`."""

import sys

from wholebody.cli import main

if __name__ == "__main__":
    sys.exit(main())
