"""What each command does: reads, calls the pipeline, saves, prints, and returns the exit code.

Nothing is written before the problem has been read, and nothing but files that a run of ours made is replaced
(``dexplan.run_folder``).  A run folder is emptied of an older run's files before the first new one is written, so what stands
there belongs together.

=============  ================================================================================
``problems``   ``list_everything``, ``show``, ``new``, ``inspect``, ``plan``: what is asked without running
``runs``       ``run``, ``validate``, ``render``, ``draw_figures``: runs made, judged again, filmed, drawn
``scenes``     ``doctor``, ``stability``: this machine, and any MuJoCo scene
``voice``      how much is said: ``-q`` and ``-v``
=============  ================================================================================

>>> from dexplan.commands import problems
>>> problems.list_everything()  # doctest: +ELLIPSIS
problem  adjust_grasp ...
scene    three_finger_sphere ...
0
"""

__all__ = ["problems", "runs", "scenes", "voice"]
