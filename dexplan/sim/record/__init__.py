"""Steps the world under the controller and records what happened; a run that fails keeps its trace so far.

=============  ==========================================================================
``rollout``    ``rollout(scene, reference, options)``: the run, as a ``Trace``
``keyframes``  ``name_states``: start and goal of the run, as keyframes of its model
=============  ==========================================================================
"""

__all__ = ["keyframes", "rollout"]
