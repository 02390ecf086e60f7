"""What a long computation calls with each of its steps, in words."""

from collections.abc import Callable

Progress = Callable[[str], None]
