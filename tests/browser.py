"""Pages: what a browser without a window makes of them, and the figures that they hold."""

import base64
import json
import re
import subprocess
import zlib
from pathlib import Path

import pytest

CHROMIUM = Path("/usr/bin/chromium")
needs_chromium = pytest.mark.skipif(not CHROMIUM.exists(), reason="needs the Chromium browser")


def dom_of(page: Path, fragment: str = "") -> str:
    """Return what a page becomes after 8 s of the browser's clock, without its scripts."""
    command = [
        str(CHROMIUM),
        *("--headless", "--no-sandbox", "--disable-quic", "--no-first-run"),
        *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
        *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1400,1000"),
        f"--user-data-dir={page.parent / 'profile'}",
        *("--virtual-time-budget=8000", "--dump-dom", page.as_uri() + fragment),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return without_scripts(done.stdout)


def without_scripts(html: str) -> str:
    """Return a page without its scripts and data."""
    return re.sub(r"<script.*?</script>", "", html, flags=re.DOTALL)


def figures(page: str) -> list[dict]:
    """Return the figures of a page as plotly draws them."""
    packed = re.findall(r'<script type="application/octet-stream"[^>]*>([^<]*)<', page)
    return [json.loads(zlib.decompress(base64.b64decode(data))) for data in packed]
