"""Named states in the model that a run was recorded on: where it started, and where its plan ends.

Whoever opens ``model.xml`` in MuJoCo finds them in its list of keyframes.  A keyframe is data beside the physics: it is read by
those who reset to it, never by a step.  To replay a run bit for bit takes ``initial_state`` of the trace, which also holds
what the solver remembers; keyframes do not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dexplan.kinematics.chain import solve_ik
from dexplan.plans.plan import Plan
from dexplan.scene.scene import Scene
from dexplan.sim.trace import Trace
from dexplan.spatial import Array

END = "</mujoco>"
"""What the text of a model ends with."""


def name_states(trace: Trace, plan: Plan, scene: Scene) -> Trace:
    """Return ``trace`` with the keyframes ``start`` and ``goal`` in its model; ``scene`` is the one that was simulated.

    ``start`` is the first sample with its controls; ``goal`` is the object where the plan ends, the fingers at their last
    contacts or at home, servos holding these angles.  Everything is at rest.
    """
    if trace.sample_count == 0 or not plan.actions or END not in trace.model_xml:
        return trace
    posture = compute_goal_posture(plan, scene)
    ctrl = np.zeros(scene.model.nu)
    ctrl[scene.actuators] = posture
    keys = [
        _write_key("start", trace["qpos"][0], trace["ctrl"][0]),
        _write_key("goal", scene.as_qpos(posture, plan.actions[-1].X_WO_end), ctrl),
    ]
    before, _, after = trace.model_xml.rpartition(END)
    text = "  <keyframe>\n" + "".join(f"    {key}\n" for key in keys) + "  </keyframe>\n"
    return replace(trace, model_xml=f"{before}{text}{END}{after}")


def compute_goal_posture(plan: Plan, scene: Scene) -> Array:
    """Return the joint angles (F, J) [rad] where the plan ends, free fingers at home."""
    last = plan.actions[-1]
    posture = []
    for finger, contact in zip(scene.fingers, last.contacts_end, strict=True):
        q = finger.q_home
        if contact is not None:
            # A contact remembers the posture in which it was made; the object has moved since.
            q, _ = solve_ik(
                finger.chain, (last.X_WO_end @ contact.X_OF)[None], contact.q[None], iterations=60
            )
            q = q[0]
        posture.append(q)
    return np.stack(posture)


def _write_key(name: str, qpos: Array, ctrl: Array) -> str:
    """Return a keyframe as MJCF, every bit of its numbers kept."""
    return f'<key name="{name}" qpos="{_spell(qpos)}" ctrl="{_spell(ctrl)}"/>'


def _spell(values: Array) -> str:
    return " ".join(repr(float(x)) for x in values)
