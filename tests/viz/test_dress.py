"""What is only seen: it is put on the model that is drawn, links meet, and nothing of it is physics."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from turning_run import make_trace

from dexplan.scene.description import SceneParameters
from dexplan.scene.library import load_scene, load_scene_with
from dexplan.spatial import Array, direction_from_angles
from dexplan.viz.dress import dress_model
from dexplan.viz.palette import as_rgb, get_finger_color
from dexplan.viz.skins import IVORY, STRIPE, build_cube_directions, paint_object, paint_tip

FINGERS = ("finger_1", "finger_2", "finger_3")


@pytest.fixture(scope="module")
def dressed() -> mujoco.MjModel:
    return dress_model(make_trace().model_xml, FINGERS)


def test_physics_is_the_same_bit_for_bit(dressed: mujoco.MjModel) -> None:
    """Stepped with the same controls, the model with everything seen gives the same positions as the one without."""
    plain = mujoco.MjModel.from_xml_string(make_trace().model_xml)
    assert dressed.ngeom > plain.ngeom
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_armature", "body_subtreemass"):
        assert np.array_equal(getattr(dressed, name), getattr(plain, name)), name
    runs = []
    for model in (plain, dressed):
        data = mujoco.MjData(model)
        data.qpos[:] = make_trace()["qpos"][0]
        rng, found = np.random.default_rng(0), []
        for _ in range(300):
            data.ctrl[:] = data.qpos[: model.nu] + rng.normal(0.0, 0.2, model.nu)
            mujoco.mj_step(model, data)
            found.append(np.concatenate([data.qpos, data.qvel]))
        runs.append(np.array(found))
    assert np.array_equal(runs[0], runs[1])


def test_the_scene_itself_carries_nothing_of_it() -> None:
    assert "_seen" not in load_scene().xml


def test_what_is_added_touches_nothing(dressed: mujoco.MjModel) -> None:
    plain = mujoco.MjModel.from_xml_string(make_trace().model_xml)
    known = {plain.geom(g).name for g in range(plain.ngeom)}
    added = [g for g in range(dressed.ngeom) if dressed.geom(g).name not in known]
    assert {dressed.geom(g).name.split("/")[1] for g in added} >= {"palm_seen", "stem_seen", "fork_seen"}
    assert not dressed.geom_contype[added].any()
    assert not dressed.geom_conaffinity[added].any()


def _count_pieces(model: mujoco.MjModel, finger: str, qpos: Array) -> int:
    """Return into how many separate pieces the geoms of a finger fall that are seen at a pose."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    geoms = [
        g
        for g in range(model.ngeom)
        if model.geom(g).name.startswith(f"{finger}/") and model.geom_group[g] <= 2
    ]
    group = {g: g for g in geoms}
    for i, a in enumerate(geoms):
        for b in geoms[i + 1 :]:
            # The front half of a tip is a mesh, whose distance takes long: its stem ends at its middle.
            if mujoco.mj_geomDistance(model, data, a, b, 0.001, None) <= 0.0:
                old, new = group[a], group[b]
                group = {g: new if k == old else k for g, k in group.items()}
    return len(set(group.values()))


def test_links_meet_in_every_posture(dressed: mujoco.MjModel) -> None:
    plain = mujoco.MjModel.from_xml_string(make_trace().model_xml)
    rng = np.random.default_rng(1)
    for _ in range(6):
        qpos = make_trace()["qpos"][0].copy()
        limits = plain.jnt_range[: plain.nu]
        qpos[: plain.nu] = rng.uniform(limits[:, 0], limits[:, 1])
        for finger in FINGERS:
            assert _count_pieces(dressed, finger, qpos) == 1
    assert _count_pieces(plain, "finger_1", qpos) > 1


def test_old_and_foreign_models_are_drawn_as_they_are() -> None:
    xml = '<mujoco><worldbody><body name="b"><geom name="g" size="1"/></body></worldbody></mujoco>'
    assert dress_model(xml, ("finger_1",)).ngeom == 1


def test_the_object_repeats_after_a_whole_turn_only() -> None:
    """No turn about any axis below 360 degrees leaves the pattern as it was."""
    n = build_cube_directions(24).reshape(-1, 3)
    before = paint_object(n)
    for degrees in range(15, 360, 15):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        for axes in ((0, 1), (1, 2), (2, 0)):
            turned = n.copy()
            turned[:, axes] = n[:, axes] @ np.array([[c, s], [-s, c]])
            assert (np.abs(paint_object(turned) - before).max(axis=1) > 50).mean() > 0.01, (degrees, axes)


def test_the_arrow_runs_along_the_meridian_of_azimuth_zero() -> None:
    assert tuple(paint_object(direction_from_angles(0.0, 45.0))) == STRIPE
    assert tuple(paint_object(direction_from_angles(180.0, 45.0))) != STRIPE
    assert tuple(paint_object(direction_from_angles(15.0, 45.0))) == IVORY


def test_tips_have_one_broad_meridian() -> None:
    color = np.array([0.0, 0.4, 0.7])
    azimuth = np.radians(np.arange(0.0, 360.0, 0.5))
    ring = np.stack(
        [np.sin(1.0) * np.cos(azimuth), np.sin(1.0) * np.sin(azimuth), np.full_like(azimuth, np.cos(1.0))],
        axis=1,
    )
    is_line = np.abs(paint_tip(ring, color) - 255.0 * color).max(axis=1) > 20.0
    edges = np.flatnonzero(np.diff(np.roll(is_line, 45).astype(int)))
    widths = np.diff(edges)[::2]
    assert len(widths) == 8
    assert sorted(widths)[-1] > 2 * sorted(widths)[-2]


def test_texels_of_a_tip_lie_where_its_pole_says(dressed: mujoco.MjModel) -> None:
    """The painted texture, looked up where MuJoCo would, shows the broad meridian on one side of the pole only."""
    texture = dressed.texture("finger_1/skin_seen")
    side = int(texture.width[0])
    start = int(texture.adr[0])
    pixels = dressed.tex_data[start : start + 18 * side * side].reshape(6, side, side, 3).astype(float)
    assert (pixels.min(axis=-1) > 240).mean() > 0.01


def test_another_kind_of_finger_gets_no_parts_of_this_one() -> None:
    """A hand of TriFinger's fingers is drawn as it is, each tip in the colour of its finger."""
    xml = load_scene_with(SceneParameters(finger="trifinger", tip_radii=(0.01,) * 3)).xml
    seen = dress_model(xml, FINGERS)
    assert not any(seen.geom(g).name.endswith("_seen") for g in range(seen.ngeom))
    for k, finger in enumerate(FINGERS):
        material = seen.mat(int(seen.geom(f"{finger}/tip").matid[0]))
        assert np.allclose(material.rgba[:3], as_rgb(get_finger_color(k)), atol=1e-6)
