"""What is no ball is refused by name where the code takes it for one: as a fingertip, and as a sphere's surface."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dexplan.contact.bodies.edged import BoxBody
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
def test_other_tips_are_not_called_balls(kind: str, size: str) -> None:
    with pytest.raises(DexplanError, match=f"'finger_2/tip' is of type {kind}; .*sphere\" is accepted"):
        scene_from_xml("other", with_geom("finger_2/tip", type=kind, size=size))


def test_other_objects_are_described_and_have_no_sphere() -> None:
    other = scene_from_xml("other", with_geom("object/surface", type="box", size="0.035 0.03 0.04")).object
    assert other.body == BoxBody(0.035, 0.03, 0.04)
    with pytest.raises(DexplanError, match="of kind BoxBody what holds on a ball alone"):
        _ = other.surface


def test_a_plane_is_no_object() -> None:
    """MuJoCo takes no plane that moves; a shape that it takes and we do not is refused by name."""
    xml = with_geom("object/surface", type="plane", size="0.1 0.1 0.1")
    with pytest.raises((DexplanError, ValueError)):
        scene_from_xml("other", xml)


def test_a_surface_beside_the_origin_is_refused() -> None:
    with pytest.raises(DexplanError, match=r"surface is \[0\.01, 0\.0, 0\.0\] m from the origin of its body"):
        scene_from_xml("other", with_geom("object/surface", pos="0.01 0 0"))
