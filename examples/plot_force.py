"""Plot one finger's normal force, planned and measured, from the folder of a run: runs/turn."""

import numpy as np
from matplotlib.figure import Figure

import dexplan as dx

trace = dx.Trace.load("runs/turn/trace.npz")
finger = 2  # the third one: it lands during the run
time, touches = trace["time"], trace["contact_active"][:, finger]
measured = trace["contact_force"][:, finger, 2]  # (f_t1, f_t2, f_n, tau_n): on the object, n into it
planned = trace["contact_force_reference"][:, finger, 2]

print(f"touches from {time[touches][0]:.2f} s on")
print(f"presses with {measured[-1]:.2f} N in the end, {np.nanmax(measured):.2f} N at most")

figure = Figure(figsize=(8.0, 3.2), layout="constrained")
axes = figure.subplots()
axes.plot(time, measured, color="#0072B2", label="measured")
axes.plot(time, planned, color="black", linestyle=":", label="asked for by the force program")
axes.set(xlabel="time [s]", ylabel="normal force of finger 3 [N]", xlim=(0.0, time[-1]), ylim=(0.0, None))
axes.legend(frameon=False)
figure.savefig("finger_force.png", dpi=100)
