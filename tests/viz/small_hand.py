"""The built-in hand with workspaces that are made in no time: seeds around home, enough for pictures."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dexplan.contact.friction import SoftFinger
from dexplan.kinematics.chain import compute_joint_margin, compute_tip_pose
from dexplan.kinematics.workspace import Workspace
from dexplan.planning.admissible.hand import HandModel
from dexplan.scene.library import load_scene
from dexplan.scene.probe import HandProbe

MU, MU_T = 0.55 / 1.3, 0.0025 / 1.3


@lru_cache
def make_hand() -> HandModel:
    """Return the hand with workspaces of a few hundred postures around home."""
    scene, workspaces = load_scene(), []
    for finger in scene.fingers:
        rng = np.random.default_rng(0)
        q = finger.q_home + rng.uniform(-0.9, 0.9, (4000, 6))
        q[:, -1] = 0.0
        q = q[compute_joint_margin(finger.chain, q) > 0.1]
        X = compute_tip_pose(finger.chain, q)
        zeros = np.zeros(len(q))
        workspaces.append(
            Workspace(
                finger.chain, q, X[:, :3, 3], X[:, :3, 2], zeros, np.stack([zeros, zeros], axis=1), 0, len(q)
            )
        )
    return HandModel(
        scene.fingers, scene.object, tuple(workspaces), SoftFinger(MU, MU_T), HandProbe(scene)
    )  # fmt: skip
