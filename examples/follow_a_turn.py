"""A computed controller of your own: resolved rates follow the plan's turn, and a squeeze towards the ball's centre holds it.

    python examples/follow_a_turn.py

No quadratic program: each tip is carried with where the plan has the ball, and all press with the same force.
"""

from __future__ import annotations

import mujoco
import numpy as np

import dexplan as dx

SQUEEZE = 5.5
"""Normal force of each finger [N]."""


class CarryAlong:
    """Carries the tips that hold with the plan's motion of the object."""

    def reset(self, start: dx.RunStart) -> None:
        """Note where each tip is on the object."""
        self.model = mujoco.MjModel.from_xml_string(start.model_xml)
        self.data, self.tick = mujoco.MjData(self.model), start.tick
        self.rows = [self.model.joint(name).dofadr[0] for name in start.joints]
        self.tips = [self.model.site(f"{finger}/tip_center").id for finger in start.fingers]
        self.radii = [self.model.geom(f"{finger}/tip").size[0] for finger in start.fingers]
        self.posture = np.zeros(self.model.nv)
        self.posture[self.rows] = start.observation.q.ravel()
        X_OW = np.linalg.inv(start.observation.X_WO)
        self.X_OF = [X_OW @ X_WF for X_WF in self.find_tips()]

    def find_tips(self) -> list[np.ndarray]:
        """Return the pose (4, 4) of every tip at the commanded posture."""
        self.data.qpos[self.rows] = self.posture[self.rows]
        mujoco.mj_forward(self.model, self.data)
        poses = []
        for tip in self.tips:
            X = np.eye(4)
            X[:3, :3], X[:3, 3] = self.data.site_xmat[tip].reshape(3, 3), self.data.site_xpos[tip]
            poses.append(X)
        return poses

    def step(self, observation: dx.Observation) -> np.ndarray:
        """Return the targets of the servos [rad], in the order of ``observation.q.ravel()``."""
        model, data, motion = self.model, self.data, observation.motion
        X_WF = self.find_tips()
        torque, qdot = data.qfrc_bias.copy(), np.zeros(model.nv)
        weight = -model.opt.gravity * model.body("object/").mass
        J = np.zeros((6, model.nv))
        for k in np.flatnonzero(motion.holding):
            now, wanted = X_WF[k], motion.X_WO_next @ self.X_OF[k]
            turn = 0.5 * np.cross(now[:3, :3], wanted[:3, :3], axis=0).sum(axis=1)
            mujoco.mj_jacSite(model, data, J[:3], J[3:], self.tips[k])
            qdot += np.linalg.pinv(J, rcond=1e-4) @ np.append(wanted[:3, 3] - now[:3, 3], turn) / self.tick
            inward = observation.X_WO[:3, 3] - now[:3, 3]
            inward /= np.linalg.norm(inward)
            force = SQUEEZE * inward + weight / motion.holding.sum()
            point, body = now[:3, 3] + self.radii[k] * inward, model.site_bodyid[self.tips[k]]
            mujoco.mj_applyFT(model, data, force, np.zeros(3), point, body, torque)
        self.posture += qdot * self.tick
        # A position servo gives gain x (target - angle) - damping x speed.
        gain, damping = model.actuator_gainprm[:, 0], -model.actuator_biasprm[:, 2]
        return self.posture[self.rows] + (torque[self.rows] + damping * qdot[self.rows]) / gain


def main() -> None:
    """Turn the ball by 72 degrees with fixed contacts."""
    problem = dx.load_problem("fixed_contacts")
    plan = dx.plan(problem)
    trace = dx.rollout(problem, plan, controller=CarryAlong())
    print(dx.validate(problem, plan, trace).summary_line())


if __name__ == "__main__":
    main()
