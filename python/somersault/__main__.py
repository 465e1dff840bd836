"""Command line: ``python -m somersault``."""

import sys

from somersault.cli import main

if __name__ == "__main__":
    sys.exit(main())
