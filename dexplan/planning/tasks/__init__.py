"""What a caller asks for: one module per kind of goal, and what is said where there is no plan.

=========================  ==========================================================================
``rolling_start``          ``plan_object_manipulation``: from any start, rolling first where it must
``object_manipulation``    ``plan_rotation``: turns, attitudes and shifts by gaits [paper §1 (1)]
``grasp_adjustment``       ``plan_grasp_adjustment``: goal contacts, whatever the pose [paper §1 (2)]
``dextrous_manipulation``  ``plan_dextrous_manipulation``: both, in three orders [paper §1 (3)]
``starting``               ``Start``: the contacts that a problem begins with
``fixed_contacts``         ``plan_fixed_contacts``: no finger leaves its contact
=========================  ==========================================================================
"""

__all__ = [
    "blocked",
    "dextrous_manipulation",
    "fixed_contacts",
    "grasp_adjustment",
    "object_manipulation",
    "rolling_start",
    "starting",
]
