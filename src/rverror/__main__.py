"""``python -m rverror``."""

import sys

from rverror.app.command_line import main

sys.exit(main())
