"""Values in, files out: the film of a run, its summary, maps of what a hand reaches, rows of frames.

==================  ===========================================================================>>> from dexplan.viz.palette import get_finger_color
>>> get_finger_color(0)
'#0072B2'
"""

__all__ = [
    "canvas",
    "check_words",
    "curves",
    "figure",
    "film",
    "frames",
    "maps",
    "palette",
    "refusal",
    "story",
    "summary_panels",
    "timeline",
    "video",
]
