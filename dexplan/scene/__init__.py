"""The world: fingers, object, obstacles, composed as an MJCF model; the only door to MuJoCo's conventions.

=================  =====================================================================================
``library``        ``load_scene``: a built-in scene by name, with parameters changed
``scene``          ``Scene``: the compiled model and where everything in it is
``description``    the same as values without MuJoCo: hand, object, obstacles.  What planning sees.
``shape``          ``Shape``: which body the object is, as a plain value
``mesh_file``      ``read_mesh``: an OBJ or STL file as triangles
``probe``          ``HandProbe``: what is nearest, and torques; MuJoCo's answers to planning's questions
``penetration``    how deep a squeeze presses a tip into an object at rest
``touch``          which contacts MuJoCo reports, as contacts of fingers
``object_parts``   ``read_object``: body and mass of a compiled model's object
``finger_models``  ``FINGER_MODELS``: the kinds of finger a hand can have
=================  =====================================================================================

>>> from dexplan.scene.library import load_scene
>>> scene = load_scene(object_mass=0.120)
>>> len(scene.fingers), float(scene.model.body("object/").mass[0].round(3))
(3, 0.12)
"""

__all__ = [
    "description",
    "finger_models",
    "library",
    "mesh_file",
    "object_parts",
    "penetration",
    "probe",
    "scene",
    "shape",
    "touch",
]
