"""The pages of the project."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from hashlib import sha256
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def without_scripts(page: str) -> str:
    """A page less the data of its figures and the scripts that its policy allows, which may reach nothing."""
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy
    rules = policy[1].split("; ")
    assert rules[0] == "default-src 'none'"
    assert {rule.split()[0] for rule in rules[1:]} <= {"style-src", "img-src", "script-src"}
    assert "img-src data:" in rules or "img-src" not in policy[1]
    allowed = re.findall(r"'sha256-([^']*)'", policy[1])

    def left(script: re.Match[str]) -> str:
        if script[1] == ' type="application/json"':
            assert json.loads(script[2])["axes"]
        else:
            assert script[1] == ""
            assert b64encode(sha256(script[2].encode()).digest()).decode() in allowed
        return ""

    return re.sub(r"<script([^>]*)>(.*?)</script>", left, page, flags=re.DOTALL)
