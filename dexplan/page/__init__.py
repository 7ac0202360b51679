"""The page about a run: one HTML file that holds everything, needs no network and no JavaScript, and opens on a phone.

===========  ==================================================================================
``report``   ``write_report``: ``report.html`` of a run, of a failure, or of a refusal
===========  ==================================================================================

Elements are built as a tree of ``xml.etree`` and written by its HTML serialiser, so whatever a problem file says is text and
never markup; the page's own security policy forbids loading anything.  No time of day stands in it: the same run gives the same
bytes.

>>> from dexplan.page.html import build, as_html
>>> as_html(build("p", "a < b", class_="note"))
'<p class="note">a &lt; b</p>'
"""

__all__ = ["report"]
