"""``python -m rverror``."""

import sys

from rverror.cli import main

sys.exit(main())
