"""`python -m studies.cli` is the command `magtip`."""

import sys

from studies.cli import main

sys.exit(main())
