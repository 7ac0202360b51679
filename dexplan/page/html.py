"""HTML as a tree of elements: text is escaped where it is written, so nothing that users wrote becomes markup."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

Child = Element | str | None
_CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff]")
"""Characters that no HTML page may hold."""


def build(tag: str, *children: Child | Iterable[Child], **attributes: str | None) -> Element:
    """Return an element with ``children``: texts, elements, sequences of both; None stands for nothing.

    A trailing underscore of an attribute's name is dropped, others become hyphens: ``class_``, ``aria_label``.  An attribute
    that is None is left out.
    """
    element = Element(tag)
    for name, value in attributes.items():
        if value is not None:
            element.set(name.rstrip("_").replace("_", "-"), _clean(value))
    for child in children:
        if child is None or isinstance(child, str | Element):
            _append(element, child)
        else:
            for item in child:
                _append(element, item)
    return element


def _append(element: Element, child: Child) -> None:
    if isinstance(child, Element):
        element.append(child)
    elif child:
        text = _clean(child)
        if len(element):
            element[-1].tail = (element[-1].tail or "") + text
        else:
            element.text = (element.text or "") + text


def _clean(text: str) -> str:
    """Return a text with a replacement character for each that no page may hold."""
    return _CONTROL.sub("\N{REPLACEMENT CHARACTER}", text)


def build_table(
    heads: Sequence[str], rows: Iterable[Sequence[Child | Iterable[Child]]], **attributes: str
) -> Element:
    """Return a table; each cell knows the head of its column, so that a narrow page can show rows as cards."""
    body = build("tbody")
    for row in rows:
        cells = (build("td", cell, data_head=head) for head, cell in zip(heads, row, strict=True))
        body.append(build("tr", cells))
    head = build("thead", build("tr", (build("th", text, scope="col") for text in heads)))
    return build("table", head, body, **attributes)


def build_facts(facts: Iterable[Sequence[Child]]) -> Element:
    """Return a list of names and what is said of them."""
    pairs = [(build("dt", name), build("dd", value)) for name, value in facts]
    return build("dl", (part for pair in pairs for part in pair))


def build_section(anchor: str, title: str, *children: Child | Iterable[Child]) -> Element:
    """Return a section with its heading, which links can name."""
    return build("section", build("h2", title), *children, id=anchor)


def build_picture(data: bytes, words: str, kind: str = "png", class_: str | None = None) -> Element:
    """Return a picture that is part of the page; ``words`` say what it shows, to those who do not see it."""
    return build("img", src=as_data_uri(data, f"image/{kind}"), alt=words, class_=class_)


def as_data_uri(data: bytes, kind: str) -> str:
    """Return ``data`` as an address that holds it."""
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"


def as_html(element: Element) -> str:
    """Return an element as HTML text."""
    return ElementTree.tostring(element, encoding="unicode", method="html")
