"""Check that no page of a built site loads anything from another host.

    python docs/_ext/own_host.py build/docs

Links that a reader follows may lead anywhere; what a browser loads by itself may not: scripts,
style sheets, pictures, fonts, frames.
"""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path

__all__ = ["foreign_in"]

FOREIGN = re.compile(r"\s*(?:[a-z]+:)?//", re.IGNORECASE)
IN_STYLE = re.compile(r"""(?:@import|url\()\s*["']?((?:[a-z]+:)?//[^"')\s]+)""", re.IGNORECASE)
# A host in quotes; the names of XML vocabularies look like one, and nothing asks them.
IN_SCRIPT = re.compile(r"""["'`]((?:https?:|wss?:)?//(?!www\.w3\.org/)[\w-][^"'`\s]*)["'`]""")
LOADED = ("src", "srcset", "data", "poster", "background", "action")


class _Page(HTMLParser):
    """Collects the addresses on other hosts that a page loads."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._inside = tag
        for name, value in attrs:
            loads = name in LOADED or (name.endswith("href") and tag != "a")
            if loads and value and FOREIGN.match(value):
                self.found.append(value)
            elif name == "style" and value:
                self.found += IN_STYLE.findall(value)

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        pattern = {"style": IN_STYLE, "script": IN_SCRIPT}.get(self._inside)
        if pattern is not None:
            self.found += pattern.findall(data)


def foreign_in(file: Path) -> list[str]:
    """Return the addresses on other hosts that an HTML, CSS, JavaScript or SVG file loads."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".css":
        return IN_STYLE.findall(text)
    if file.suffix == ".js":
        return IN_SCRIPT.findall(text)
    page = _Page()
    page.feed(text)
    return page.found


def main(site: Path) -> int:
    """Print what pages load from other hosts; return 1 if there is any, or no page."""
    files = [f for f in sorted(site.rglob("*")) if f.suffix in {".html", ".css", ".js", ".svg"}]
    found = [(file, address) for file in files for address in foreign_in(file)]
    for file, address in found:
        print(f"{file}: loads {address} from another host")
    if not files:
        print(f"{site}: there is no page")
    return int(bool(found) or not files)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
