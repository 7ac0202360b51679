"""Values in, files out: the film of a run, its summary, maps of what a hand reaches, rows of frames.

==================  ==================================================================================
``body``            ``read_body``: which body a model's object is
``video``           ``render_video``, ``render_frame``: offscreen, in a process of their own
``film``            ``FilmOptions``: size, cameras, pictures per second, quality; ``Film``: what was made
``story``           what a film tells: which finger moves, why, where it is to end
``figure``          ``draw_summary``: who held when, how hard, how near to slipping
``refusal``         ``draw_refusal``: what is out of reach, where friction cones miss
``curves``          ``compute_curves``: what the summary draws over time
``summary_panels``  the panels of the summary; ``describe_briefly``: an action in two or three words
``check_words``     what each check is called and means, for readers
``maps``            ``describe_reach``, ``draw_reach``: what a hand can do around its object
``frames``          ``draw_run_frames``: rows of numbered frames like the paper's figures
``timeline``        what pictures say about a run: who holds when, how far the object has turned
``palette``         colours that mean the same in every picture
==================  ==================================================================================

>>> from dexplan.viz.palette import get_finger_color
>>> get_finger_color(0)
'#0072B2'
"""

__all__ = [
    "body",
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
