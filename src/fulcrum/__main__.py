"""Run the command line: ``python -m fulcrum``."""

import sys

from fulcrum.scenarios.cli import main

sys.exit(main())
