"""One finger as a chain of hinges: forward, inverse, workspace and arcs; no MuJoCo.

====================  ================================================================================================
``chain``             ``Chain``; ``compute_tip_pose``, ``compute_tip_jacobian``, ``solve_ik`` by damped Newton steps
``finger``            ``FingerDescription``: a chain with its tip, servos and home posture
``spherical_wrist``   inverse kinematics in closed form, where the last three hinges meet in a point
``pointing``          postures that point the tip in a direction, whatever its spin
``following``         ``follow_tip``: postures along a way of the tip, on one branch
``workspace``         ``Workspace``, ``load_workspace``: where the tip can be, computed once and kept on disk
``land``              ``land``: postures that touch given places of a body, for any number of joints
``carry``             ``carry_fixed``, ``carry_rolling``: how far a contact goes along while the object moves
``may_carry``         ``compute_steering``: what fingers decide of the object's motion, and what they leave to torsion
``arcs``              ``build_travel``, ``compute_hover``: how a free tip travels around the object
====================  ================================================================================================

A finger of two hinges about y, 40 mm and 30 mm long, stretched out along x:

>>> import numpy as np
>>> from dexplan.kinematics.chain import Chain, compute_tip_pose
>>> offsets = np.tile(np.eye(4), (2, 1, 1))
>>> offsets[1, 0, 3] = 0.040
>>> X_JF = np.eye(4)
>>> X_JF[0, 3] = 0.030
>>> finger = Chain(offsets, np.array([[0.0, 1.0, 0.0]] * 2), X_JF, np.full(2, -2.0), np.full(2, 2.0))
>>> compute_tip_pose(finger, [0.0, 0.0])[:3, 3].round(3).tolist()
[0.07, 0.0, 0.0]
"""

__all__ = [
    "arcs",
    "carry",
    "chain",
    "finger",
    "following",
    "land",
    "may_carry",
    "pointing",
    "spherical_wrist",
    "workspace",
]
