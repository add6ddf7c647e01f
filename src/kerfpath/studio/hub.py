"""The open pages, and the newest message of each kind for them."""

from __future__ import annotations

import asyncio
from collections import OrderedDict

from kerfpath.studio.messages import Message

LAST = (
    "job",
    "options",
    "part",
    "scene",
    "program",
    "outcome",
    "progress",
    "kept",
    "front",
    "layout",
)
"""Kinds of messages whose last one a new page gets; it also gets the last plans per contour."""


class Page:
    """One open page with the messages that wait for it, only the newest of each kind.

    A page that does not read holds no more memory than one full set of messages.
    """

    def __init__(self) -> None:
        self._waiting: OrderedDict[object, str] = OrderedDict()
        self._there = asyncio.Event()

    def put(self, key: object, text: str) -> None:
        """Queue a message; it replaces a waiting one with the same key."""
        self._waiting[key] = text
        self._waiting.move_to_end(key)
        self._there.set()

    def say(self, message: Message) -> None:
        """Queue an answer; it replaces a waiting one of the same kind about the same contour."""
        about = [getattr(message, name, None) for name in ("type", "contour", "about")]
        self.put(tuple(about), message.model_dump_json())

    async def next(self) -> str:
        """Return the next message, once there is one."""
        while not self._waiting:
            self._there.clear()
            await self._there.wait()
        _, text = self._waiting.popitem(last=False)
        return text


class Hub:
    """All open pages, and the messages that a new page gets first."""

    def __init__(self) -> None:
        self._pages: set[Page] = set()
        self._last: dict[str, str] = {}
        self._of_contour: dict[str, OrderedDict[str, str]] = {}

    def __len__(self) -> int:
        return len(self._pages)

    def open(self) -> Page:
        """Return a new page; the last message of each kind is queued for it."""
        page = Page()
        for kind in LAST:
            if kind in self._last:
                page.put(kind, self._last[kind])
        for contour, said in self._of_contour.items():
            for name, text in said.items():
                page.put((contour, name), text)
        self._pages.add(page)
        return page

    def close(self, page: Page) -> None:
        """Forget a page."""
        self._pages.discard(page)

    def say(self, message: Message) -> None:
        """Send a message to every page, and keep it for pages that open later."""
        kind, text = str(getattr(message, "type", "")), message.model_dump_json()
        contour = getattr(message, "contour", None)
        key: object = kind
        if kind == "clearance":
            name = f"clearance {getattr(message, 'name', '')}"
            self._of_contour.setdefault(str(contour), OrderedDict())[name] = text
            key = contour, name
        elif kind in ("plan", "nopath"):
            key = self._keep(str(contour), kind, message, text)
        else:
            self._last[kind] = text
        for page in self._pages:
            page.put(key, text)

    def keep_only(self, contours: list[str]) -> None:
        """Forget the messages about contours that the job no longer has."""
        for gone in self._of_contour.keys() - set(contours):
            del self._of_contour[gone]

    def _keep(self, contour: str, kind: str, message: Message, text: str) -> object:
        """Keep a contour's plan, the plans of its pieces, or the reason why it has none."""
        name = kind if kind == "nopath" else f"plan {getattr(message, 'name', '')}"
        said = self._of_contour.setdefault(contour, OrderedDict())
        alone = kind == "nopath" or getattr(message, "pieces", 1) == 1 or "nopath" in said
        if alone:
            said.clear()
        said[name] = text
        return contour, name
