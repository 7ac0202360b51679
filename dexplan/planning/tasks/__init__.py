"""What a caller asks for: one module per kind of goal, and what is said where there is no plan.

=========================  ==========================================================================
``rolling_start``          ``plan_object_manipulation``: from any start, rolling first where it must
``object_manipulation``    ``plan_rotation``: turns, attitudes and shifts by gaits [paper §1 (1)]
``grasp_adjustment``       ``plan_grasp_adjustment``: goal contacts, whatever the pose [paper §1 (2)]
``dextrous_manipulation``  ``plan_dextrous_manipulation``: both, in three orders [paper §1 (3)]
``by_shape``               ``plan_gait``: gaits for balls and for other bodies
``starting``               ``Start``: the contacts that a problem begins with
``waypoints``              ``plan_waypoints``: several goals in a row, from grasp to grasp
``fixed_contacts``         ``plan_fixed_contacts``: no finger leaves its contact
``rolling_fingers``        ``plan_rolling``: fingers of three joints and more, whose contacts roll
=========================  ==========================================================================

Callers go through :func:`dexplan.plan`, which asks the task that answers the kind of goal.  Here one is asked directly: fingers
that do not let go turn the ball by 20 degrees.

>>> import numpy as np
>>> import dexplan as dx
>>> from dexplan.pipeline import build_hand, build_scene
>>> from dexplan.planning.tasks.fixed_contacts import plan_fixed_contacts
>>> from dexplan.plans.goal import RotationGoal
>>> from dexplan.problems.problem import compute_contact_directions
>>> problem = dx.load_problem("fixed_contacts")
>>> hand = build_hand(problem, build_scene(problem))
>>> goal = RotationGoal(hand.object.X_WO_home, np.array([0.0, 0.0, 1.0]), np.radians(20.0))
>>> plan = plan_fixed_contacts(hand, goal, compute_contact_directions(problem.start.contacts_deg), 2000)
>>> str(plan.status), [action.name for action in plan.actions]
('solved', ['hold', 'move_object', 'hold'])
"""

__all__ = [
    "blocked",
    "by_shape",
    "dextrous_manipulation",
    "fixed_contacts",
    "grasp_adjustment",
    "object_manipulation",
    "rolling_fingers",
    "rolling_start",
    "starting",
    "waypoints",
]
