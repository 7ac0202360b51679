"""What is no ball is refused by name, wherever the code takes the point on a ray for the contact with that normal."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dexplan.errors import DexplanError
from dexplan.scene.compose import build_model_xml
from dexplan.scene.description import SceneParameters
from dexplan.scene.scene import Scene, scene_from_xml

XML = build_model_xml(SceneParameters())


@pytest.fixture(scope="module")
def scene() -> Scene:
    return scene_from_xml("a ball", XML)


def with_geom(name: str, **attributes: str) -> str:
    """Return the model text with other attributes of one geom."""
    (element,) = re.findall(rf'<geom name="{name}"[^>]*>', XML)
    changed = element
    for key, value in attributes.items():
        changed, count = re.subn(rf' {key}="[^"]*"', f' {key}="{value}"', changed)
        if not count:
            changed = changed.replace("<geom ", f'<geom {key}="{value}" ', 1)
    return XML.replace(element, changed)


def test_the_ball_itself_is_described(scene: Scene) -> None:
    assert scene.object.surface.radial(np.array([0.0, 0.0, 2.0])).tolist() == [0.0, 0.0, 0.035]


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        ("box", "0.035 0.035 0.035"),
        ("ellipsoid", "0.035 0.035 0.035"),
        ("ellipsoid", "0.035 0.03 0.04"),
        ("capsule", "0.035 0.01"),
        ("cylinder", "0.035 0.035"),
    ],
)
@pytest.mark.parametrize("name", ["object/surface", "finger_2/tip"])
def test_other_shapes_are_not_called_balls(name: str, kind: str, size: str) -> None:
    with pytest.raises(DexplanError, match=f"'{name}' is of type {kind}; .*sphere\" is accepted"):
        scene_from_xml("other", with_geom(name, type=kind, size=size))


def test_a_surface_beside_the_origin_is_refused() -> None:
    with pytest.raises(DexplanError, match=r"surface is \[0\.01, 0\.0, 0\.0\] m from the origin of its body"):
        scene_from_xml("other", with_geom("object/surface", pos="0.01 0 0"))
