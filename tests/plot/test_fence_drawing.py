"""A fence for the workshop: its outline, its DXF file read again, its drawing sheet."""

import errno

import ezdxf
import ezdxf.document
import ezdxf.math
import ezdxf.path
import numpy as np
import pytest

import fencejax as fj
from fencejax.design import objectives
from fencejax.model import beam
from fencejax.parts import ProfileTaper, SteppedTaper
from fencejax.plot import LAYERS, fence_drawing, fence_outline, write_dxf

STRENGTH = fj.ConstantStrength()
FENCES = {
    "two-link": fj.Fence(),
    "one-link": fj.Fence.one_link(),
    "strip": fj.Fence(0.02, 0.98, 0.2, 0.006, taper=fj.Uniform()),
    "power": fj.Fence(0.3, 0.7, taper=fj.PowerTaper(0.3)),
    "profile": fj.Fence(0.3, 0.8, taper=ProfileTaper([0.9, 1.0, 0.5, 0.7, 0.1])),
    "thin": fj.Fence(0.59196, 0.40804, 0.2, 0.021332),
    "stepped": fj.Fence(0.0, 1.2, taper=SteppedTaper(STRENGTH, 4)),
}


def mass_of(fence):
    """rho z h_1 (l_s + l_p times the integral of g that the model's mass matrix has) [kg].

    On 20 elements, at whose edges the profiles have their kinks and steps: exact for those of
    pieces, for powers by Gauss' rule in the root of the distance to the tip.
    """
    relative = float(np.asarray(beam.build_tables(fence.taper, 20, 2, np).mass[0]))
    section = float(fence.material.density * fence.width * fence.thickness)
    return section * (float(fence.rigid_length) + float(fence.flexible_length) * relative)


@pytest.mark.parametrize("name", FENCES)
def test_the_dxf_outline_has_the_models_mass(name, tmp_path):
    fence, path = FENCES[name], tmp_path / "fence.dxf"
    shape = write_dxf(path, fence, name)
    document = ezdxf.readfile(path)
    assert document.units == ezdxf.units.MM
    assert not document.audit().errors
    (outline,) = document.modelspace().query('*[layer=="OUTLINE"]')
    assert outline.closed
    # The file's own arcs as fine chords: off by 2/3 of their height times the length.
    points = list(ezdxf.path.make_path(outline).flattening(1e-5, segments=16))
    area = 1e-6 * abs(ezdxf.math.area(points))
    assert area == pytest.approx(shape.area, rel=2e-7)
    mass = area * float(fence.width) * float(fence.material.density)
    assert mass == pytest.approx(mass_of(fence), rel=1e-6)
    box = ezdxf.path.bbox([ezdxf.path.make_path(outline)])
    # An arc may stand out by as much as it may be off.
    assert box.size.x == pytest.approx(1e3 * float(fence.reach), abs=0.01)
    # The objective's own mass.
    scene = fj.scenes.oblique_impact(fence=fence)
    own = float(objectives.FENCE_MASS.read(None, scene))
    assert mass == pytest.approx(own, rel=1e-6)


def test_layers_and_dimensions_of_the_dxf(tmp_path):
    fence = fj.Fence(0.4501, 0.75, thickness=0.0333)
    write_dxf(tmp_path / "fence.dxf", fence)
    document = ezdxf.readfile(tmp_path / "fence.dxf")
    space = document.modelspace()
    assert {entity.dxf.layer for entity in space} == set(LAYERS)
    measured = sorted(round(d.get_measurement(), 6) for d in space.query("DIMENSION"))
    assert measured == [33.3, 450.1, 750.0, 1200.1]
    # And so they are written.
    texts = [e.text for d in space.query("DIMENSION") for e in d.virtual_entities()
            if e.dxftype() == "MTEXT"]  # fmt: skip
    assert sorted(texts) == ["1200.1", "33.3", "450.1", "750"]
    (joint,) = space.query('LINE[layer=="JOINT"]')
    assert tuple(joint.dxf.start)[:2] == pytest.approx((450.1, 0.0))
    (hinge,) = space.query("POINT")
    assert tuple(hinge.dxf.location) == (0, 0, 0)
    one = tmp_path / "one.dxf"
    write_dxf(one, fj.Fence.one_link())
    assert not ezdxf.readfile(one).modelspace().query('*[layer=="JOINT"]')
    # No dates, no random numbers.
    first = one.read_bytes()
    write_dxf(one, fj.Fence.one_link())
    assert one.read_bytes() == first


def test_a_full_disk_leaves_the_old_dxf(tmp_path, monkeypatch):
    path = tmp_path / "fence.dxf"
    write_dxf(path, fj.Fence.one_link())
    before = path.read_bytes()

    def half(drawing, place):
        place.write_bytes(before[: len(before) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(ezdxf.document.Drawing, "saveas", half)
    with pytest.raises(OSError, match="No space left"):
        write_dxf(path, fj.Fence())
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["two-link", "power", "profile"])
def test_the_outline_keeps_near_the_profile(name):
    fence = FENCES[name]
    x, y = fence_outline(fence).points(40)
    back = (x > float(fence.rigid_length) + 1e-9) & (y < 0) & (x < float(fence.reach) - 1e-9)
    share = (x[back] - float(fence.rigid_length)) / float(fence.flexible_length)
    exact = float(fence.thickness) * np.asarray(fence.taper(share, 1 - share))
    # Along the normal within 0.01 mm; where the profile falls steeply to the tip, more across.
    slope = np.gradient(exact, x[back])
    away = np.abs(-y[back] - exact) / np.hypot(1, slope)
    assert np.max(away[share < 0.99]) < 1.2e-5


def test_what_is_left_of_a_rigid_link_on_its_bound_is_none():
    whole = fence_outline(fj.Fence(1e-12, 1.2))
    assert whole.joint == 0.0
    np.testing.assert_array_equal(whole.x, fence_outline(fj.Fence(0.0, 1.2)).x)


def written(axes):
    """The numbers on a sheet by what they are of."""
    return {t.get_gid(): t.get_text() for t in axes.texts if t.get_gid()}


def test_the_sheets_dimensions_are_the_fences():
    fence = fj.Fence(0.31234, 0.75, 0.132, 0.04567)
    axes = fence_drawing(fence, title="a fence", material="POM (23 C)")
    texts = written(axes)
    # Rounded to a tenth of a millimetre, thicknesses to a hundredth.
    names = ("rigid_length", "flexible_length", "reach", "width", "thickness")
    assert [texts[name] for name in names] == ["312.3", "750", "1062.3", "132", "45.67"]
    for k, share in enumerate(np.linspace(0, 1, 9)):
        assert float(texts[f"h[{k}]"]) == pytest.approx(45.67 * np.sqrt(1 - share), abs=0.006)
        assert float(texts[f"x[{k}]"]) == pytest.approx(312.34 + 750 * share, abs=0.051)
    assert (texts["title"], texts["material"], texts["scale"]) == ("a fence", "POM (23 C)", "1:5")
    assert float(texts["mass"].split()[0]) == pytest.approx(mass_of(fence), rel=1e-3)
    figure = axes.get_figure(root=True)
    # A sheet of its own size, with the fence to scale on it.
    assert 25.4 * figure.get_size_inches() == pytest.approx((297, 210))
    drawn = np.concatenate([line.get_xdata() for line in axes.lines if len(line.get_xdata()) > 50])
    assert np.ptp(drawn) == pytest.approx(1062.34 / 5, rel=1e-6)


@pytest.mark.parametrize("name", FENCES)
def test_nothing_on_a_sheet_overlaps_or_leaves_it(name):
    axes = fence_drawing(FENCES[name], title="A fence with quite a long title", material="PA6 dry")
    figure = axes.get_figure(root=True)
    figure.set_dpi(100)
    figure.draw_without_rendering()
    boxes = [t.get_window_extent() for t in axes.texts if t.get_text()]
    frame = axes.transData.transform([(20, 10), (287, 200)])
    for k, box in enumerate(boxes):
        assert np.all(box.min >= frame[0])
        assert np.all(box.max <= frame[1])
        for other in boxes[:k]:
            assert not box.overlaps(other), (name, axes.texts[k].get_text())
