"""Meshes in COLLADA: unit and placement of the scene; an independent reader where there is one; damaged files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from public_arms import ARMS

from constraints.shapes import MeshError, collada_triangles

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>
<unit name="mm" meter="0.001"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 1000 0 0 1000 1000 0 0 1000 0</float_array>
<technique_common><accessor source="#a" count="4" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4</vcount><p>0 1 2 3</p></polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>0 0 500</translate><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""


def test_unit_and_placement_count_and_polygons_are_fans(tmp_path: Path) -> None:
    pytest.importorskip("collada")
    (tmp_path / "m.dae").write_text(DAE)
    triangles = collada_triangles(tmp_path / "m.dae")
    assert triangles.shape == (2, 3, 3)
    np.testing.assert_allclose(triangles.min(axis=(0, 1)), [0.0, 0.0, 0.5])
    np.testing.assert_allclose(triangles.max(axis=(0, 1)), [1.0, 1.0, 0.5])


def test_links_of_a_public_arm_are_as_another_reader_reads_them() -> None:
    pytest.importorskip("collada")
    coal = pytest.importorskip("coal")
    arm = next(arm for arm in ARMS if arm.id == "panda-hand")
    for path in sorted((arm.path.parents[1] / "meshes" / "visual").glob("link[1-3].dae")):
        triangles, known = collada_triangles(path), coal.MeshLoader().load(str(path), np.ones(3))
        known.computeLocalAABB()
        np.testing.assert_allclose(triangles.min(axis=(0, 1)), known.aabb_local.min_, atol=1e-6)
        np.testing.assert_allclose(triangles.max(axis=(0, 1)), known.aabb_local.max_, atol=1e-6)


@pytest.mark.parametrize("text", ["", "no XML", "<COLLADA/>", DAE[:600], "<!DOCTYPE x [<!ENTITY a 'b'>]>" + DAE])
def test_damaged_files_are_named(text: str, tmp_path: Path) -> None:
    pytest.importorskip("collada")
    (tmp_path / "m.dae").write_text(text)
    with pytest.raises(MeshError, match=r"m\.dae"):
        collada_triangles(tmp_path / "m.dae")


def test_without_the_package_the_message_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "collada", None)
    with pytest.raises(MeshError, match=r"pip install 'excite-trajectories\[meshes\]'"):
        collada_triangles(tmp_path / "m.dae")


def test_nodes_that_stand_for_too_many_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each node stands for two of the one before it."""
    pytest.importorskip("collada")
    nodes = '<node id="n0"><instance_geometry url="#g"/></node>' + "".join(
        f'<node id="n{k}"><instance_node url="#n{k - 1}"/><instance_node url="#n{k - 1}"/></node>' for k in range(1, 40)
    )
    text = DAE.replace("<library_visual", f"<library_nodes>{nodes}</library_nodes><library_visual")
    geometry, node = '</translate><instance_geometry url="#g"/>', '</translate><instance_node url="#n{}"/>'
    (tmp_path / "m.dae").write_text(text.replace(geometry, node.format(4)))
    assert len(collada_triangles(tmp_path / "m.dae")) == 32
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.000005")
    with pytest.raises(MeshError, match=r"m\.dae: its triangles take more than the cap of 5 kB"):
        collada_triangles(tmp_path / "m.dae")
    (tmp_path / "m.dae").write_text(text.replace(geometry, node.format(39)))
    with pytest.raises(MeshError, match=r"m\.dae: its nodes stand for more than 10000 nodes"):
        collada_triangles(tmp_path / "m.dae")
