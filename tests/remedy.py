"""What a line of wrong input must tell."""

from __future__ import annotations

import re

#: A line of wrong input must tell what to do.
REMEDY = re.compile(
    r"\b(did you mean|takes|"
    r"give|write|check|see|make|choose|use|rename|remove|correct|save|repair|measure|must be|align|change|ask|leave|"
    r"split|need|needs|complete|raise)\b"
)
