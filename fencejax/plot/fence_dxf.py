"""The outline of a fence as a DXF drawing, in millimetres.

ezdxf is imported where it is first used.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..parts import Fence
from .fence_outline import FenceOutline, fence_outline
from .whole_file import whole

if TYPE_CHECKING:
    from ezdxf.document import Drawing

LAYERS = {"OUTLINE": 7, "JOINT": 5, "HINGE": 1, "DIMENSIONS": 3}
"""Layers of the drawing, with the index of their color. Only the first one is to be cut."""
_MM = 1e3


def write_dxf(path: Path | str, fence: Fence, title: str = "") -> FenceOutline:
    """Write the outline of a fence as a DXF file (R2010, millimetres), and return it.

    Seen from above, x along the fence from the hinge, y = 0 on the face that meets the parcels:

    - `OUTLINE`: one closed polyline of lines and arcs (see `fencejax.plot.fence_outline`), whose
      area times width and density is the mass of the fence;
    - `JOINT`: the line across where the rigid link ends, if there is one;
    - `HINGE`: the axis of the hinge, a point with a cross; no hole, as the model has no bearing;
    - `DIMENSIONS`: lengths, thickness at the root and, of a straight fence, at the tip, and a note.

    The same fence and title give the same file, byte by byte.

    >>> fj.plot.write_dxf("fence.dxf", fj.Fence(), title="paper").joint
    0.45
    """
    import ezdxf
    from ezdxf import units

    shape = fence_outline(fence)
    drawing = ezdxf.new("R2010", setup=["linetypes", "styles", "dimstyles"])  # pyright: ignore
    drawing.units = units.MM
    for name, color in LAYERS.items():
        drawing.layers.add(name, color=color)
    space = drawing.modelspace()
    vertices = zip(_MM * shape.x, _MM * shape.y, shape.bulge, strict=True)
    on = lambda layer: {"layer": layer}  # noqa: E731
    space.add_lwpolyline(list(vertices), format="xyb", close=True, dxfattribs=on("OUTLINE"))
    thick, reach = _MM * float(fence.thickness), _MM * float(fence.reach)
    if fence.rest_shape is not None:
        reach = _MM * float(shape.x.max())
    joint = _MM * shape.joint
    if joint > 0:
        space.add_line((joint, 0), (joint, -thick), dxfattribs=on("JOINT"))
    arm = 0.5 * thick
    space.add_point((0, 0), dxfattribs=on("HINGE"))
    space.add_line((-arm, 0), (arm, 0), dxfattribs=on("HINGE"))
    space.add_line((0, -arm), (0, arm), dxfattribs=on("HINGE"))
    _dimensions(space, shape, thick, reach)
    note = (
        f"{title or 'fence'}\\Pwidth {_MM * float(fence.width):.6g} mm, density "
        f"{float(fence.material.density):.6g} kg/m3, mass "
        f"{shape.area * float(fence.width) * float(fence.material.density):.6g} kg\\P"
        "seen from above, millimetres, upper edge: the face"
    )
    if fence.edge_radius is not None:
        note += f"\\Pedge of the tip: radius {_MM * float(fence.edge_radius):.6g} mm, not drawn"
    if fence.rest_shape is not None:
        tip, middle = _MM * float(fence.rest_shape.tip), _MM * float(fence.rest_shape.middle)
        note += f"\\Pcurved: Bezier ordinates 0, 0, {middle:.6g}, {tip:.6g} mm over the link"
    text = space.add_mtext(note, dxfattribs={**on("DIMENSIONS"), "char_height": 0.012 * reach})
    text.set_location((0, -thick - 0.08 * reach))
    _save(drawing, Path(path))
    return shape


def _dimensions(space: Any, shape: FenceOutline, thick: float, reach: float) -> None:
    """Lengths above the face, thicknesses at the ends."""
    size = 0.012 * reach
    style = {"dimtxt": size, "dimasz": size, "dimexe": 0.4 * size, "dimexo": 0.4 * size,
             "dimgap": 0.4 * size, "dimdec": 2, "dimzin": 8, "dimlfac": 1.0}  # fmt: skip
    layer = {"layer": "DIMENSIONS"}
    joint, ends = _MM * shape.joint, shape.y[shape.x >= shape.x.max()]
    tip = -_MM * float(ends.min()) if ends.max() == 0 else 0.0

    def across(first, last, height):
        space.add_linear_dim(
            base=(0, height), p1=(first, 0), p2=(last, 0), dimstyle="EZDXF", override=style,
            dxfattribs=layer,
        ).render()  # fmt: skip

    def down(x, at, depth):
        # The number beside the line, where there is seldom room for it between the ends.
        side = 1 if at > x else -1
        space.add_linear_dim(
            base=(at, 0), p1=(x, 0), p2=(x, -depth), angle=90, dimstyle="EZDXF", override=style,
            location=(at + 3.5 * side * size, -0.5 * depth), dxfattribs=layer, text_rotation=0,
        ).render()  # fmt: skip

    if joint > 0:
        across(0, joint, 4 * size)
        across(joint, reach, 4 * size)
    across(0, reach, 8 * size)
    down(0, -4 * size, thick)
    if tip > 0:
        down(reach, reach + 4 * size, tip)


def _save(drawing: "Drawing", path: Path) -> None:
    """Write it without dates and random identifiers."""
    import ezdxf

    options: Any = ezdxf.options  # pyright: ignore
    before = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
    try:
        data = drawing.ezdxf_metadata()
        for name in ("CREATED_BY_EZDXF", "WRITTEN_BY_EZDXF"):
            data[name] = "fencejax"
        with whole(path) as part:
            drawing.saveas(part)
    finally:
        options.write_fixed_meta_data_for_testing = before
