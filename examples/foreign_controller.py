"""A controller of your own: constant servo targets hold the ball, and one that lets go is told from it.

    python examples/foreign_controller.py
    dexplan run hold_three --controller examples/foreign_controller.py:Hold

dexplan plans, simulates and judges; the controller is asked 250 times a second where the servos should go.
"""

from __future__ import annotations

import mujoco
import numpy as np

import dexplan as dx


class Hold:
    """Keeps the servos' targets where they push each touching tip against the ball, and carry the weight."""

    def __init__(self, squeeze: float = 4.0) -> None:
        """``squeeze`` is the normal force of each finger [N]."""
        self.squeeze = squeeze

    def reset(self, start: dx.RunStart) -> None:
        """Work out the targets once, with a model of the world as it is believed to be."""
        model = mujoco.MjModel.from_xml_string(start.model_xml)
        data, seen = mujoco.MjData(model), start.observation
        for name, angle in zip(start.joints, seen.q.ravel(), strict=True):
            data.joint(name).qpos = angle
        mujoco.mj_forward(model, data)
        torque = data.qfrc_bias.copy()  # gravity's part
        weight = -model.opt.gravity * model.body("object/").mass
        for finger in np.flatnonzero(seen.touching):
            tip = model.geom(f"{start.fingers[finger]}/tip")
            inward = seen.X_WO[:3, 3] - data.geom_xpos[tip.id]
            inward /= np.linalg.norm(inward)
            force = self.squeeze * inward + weight / seen.touching.sum()
            point = data.geom_xpos[tip.id] + tip.size[0] * inward
            mujoco.mj_applyFT(model, data, force, np.zeros(3), point, tip.bodyid[0], torque)
        rows = [model.joint(name).dofadr[0] for name in start.joints]
        # A position servo pushes with gain x (target - angle).
        self.targets = seen.q.ravel() + torque[rows] / model.actuator_gainprm[:, 0]

    def step(self, observation: dx.Observation) -> np.ndarray:
        """Return the targets of the servos [rad], in the order of ``observation.q.ravel()``."""
        return self.targets


class LetGo:
    """Holds for half a second and then presses no more."""

    def __init__(self) -> None:
        self.firm, self.loose = Hold(), Hold(squeeze=0.0)

    def reset(self, start: dx.RunStart) -> None:
        """Prepare both."""
        self.firm.reset(start)
        self.loose.reset(start)

    def step(self, observation: dx.Observation) -> np.ndarray:
        """Return the targets of the one whose time it is."""
        return (self.firm if observation.time < 0.5 else self.loose).step(observation)


def main() -> None:
    """Run both, and the good one on a ball that is heavier and more slippery than anybody was told."""
    problem = dx.load_problem("hold_three")
    plan = dx.plan(problem)
    for controller in (Hold(), LetGo()):
        trace = dx.rollout(problem, plan, controller=controller)
        print(dx.validate(problem, plan, trace).summary_line())
    world = dx.load_problem("hold_three", {"friction.sliding": 0.4, "object.mass_kg": 0.12})
    trace = dx.rollout(problem, plan, controller=Hold(), world=world)
    print(dx.validate(problem, plan, trace, world=world).summary_line())


if __name__ == "__main__":
    main()
