"""Ends the build if a page would fetch anything from the network."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

# What a browser fetches by itself; links that a reader may follow are none of it.
_FETCHED = re.compile(
    r"<(?:script|img|iframe|source|video|audio)\b[^>]*\bsrc=[\"']?(?:https?:)?//[^\"' >]*"
    r"|<link\b(?![^>]*\brel=[\"']?canonical)[^>]*\bhref=[\"']?(?:https?:)?//[^\"' >]*"
    r"|(?:@import|url\()\s*[\"']?(?:https?:)?//[^\"' )]*"
)


def fetched(text: str) -> list[str]:
    """The parts of a page or style sheet that fetch something from elsewhere."""
    return _FETCHED.findall(text)


def on_post_build(config: Any, **_: Any) -> None:
    """Looks through all pages and style sheets."""
    site = Path(config["site_dir"])
    for path in sorted([*site.rglob("*.html"), *site.rglob("*.css")]):
        found = fetched(path.read_text())
        if found:
            from mkdocs.exceptions import PluginError

            raise PluginError(f"{path.relative_to(site)} fetches from the network: {found[0]}")
