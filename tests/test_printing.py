"""Printed forms: numbers with units, and nothing computed within transformations."""

import html.parser

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.printing import Readable, numbers, shown
from fencejax.study import SweepTable


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.045, "m", "45 mm"),
        (1.2, "m", "1.2 m"),
        (0.99996, "m", "1 m"),
        (2e-5, "m", "0.02 mm"),
        (-3e-6, "m", "-3 um"),
        (0.0, "m", "0 m"),
        (3e9, "Pa", "3 GPa"),
        (40e6, "Pa", "40 MPa"),
        (4.5e5, "Pa", "0.45 MPa"),
        (951.98, "N", "952 N"),
        (12345.6, "N", "12.35 kN"),
        (1.72e9, "N/m^4", "1.72e9 N/m^4"),
        (0.25, "s", "250 ms"),
        (0.05, "1", "0.05"),
        (float("nan"), "m", "nan m"),
        (float("inf"), "Pa", "inf Pa"),
    ],
)
def test_numbers_as_an_engineer_writes_them(value, unit, text):
    assert shown(value, unit) == text


def test_arrays_show_a_few_numbers_or_their_shape_and_span():
    assert numbers(np.array([0.1, 2.0]), "m") == "[100 mm, 2 m]"
    assert numbers(np.linspace(0.01, 0.09, 20), "m") == "f64[20], 10 mm ... 90 mm"
    assert numbers(np.full((4, 3), np.nan), "m") == "f64[4,3]"
    assert numbers(jnp.arange(20, dtype=jnp.int32)) == "i32[20], 0 ... 19"


PARTS = {
    "Fence": (fj.Fence(), ["thickness=45 mm", "youngs_modulus=3 GPa", "taper=ConstantStrength()"]),
    "Material": (fj.Material(), ["density=1130 kg/m^3", "damping_ratio=0.05"]),
    "Parcel": (fj.Parcel(inertia=0.3), ["mass=15 kg", "inertia=0.3 kg m^2", "1.72e9 N/m^4"]),
    "Belt": (fj.Belt(), ["speed=2 m/s", "friction=Friction(kinetic=0.65, static=0.85)"]),
    "Motor": (fj.Motor(400.0), ["torque=400 N m"]),
    "SplineDrive": (fj.SplineDrive([0.1, 0.2]), ["[0.1 rad, 0.2 rad]", "cycle_time=1.36 s"]),
    "SteppedTaper": (fj.SteppedTaper(fj.Uniform(), 4), ["profile=Uniform()", "steps=4"]),
    "Deflector": (fj.surfaces.Deflector(0.3), ["angle=0.3 rad", "length=1.2 m"]),
    "DataSheet": (fj.materials.pa6_dry(), ["name='PA6 dry'", "allowed_stress=40 MPa"]),
    "Scene": (
        fj.scenes.oblique_impact(),
        ["start=AtTouch(place=1 m, drive_angle=0.3 rad", "duration=250 ms", "speed=2 m/s"],
    ),
    "NormalScene": (fj.scenes.rigid_wall(), ["speed=2.426 m/s", "duration=100 ms"]),
}


@pytest.mark.parametrize("name", PARTS)
def test_parts_print_their_numbers_with_units(name):
    part, texts = PARTS[name]
    printed = repr(part)
    assert printed.startswith(f"{name}(")
    assert [text for text in texts if text not in printed] == []
    assert str(part) == printed


class Cells(html.parser.HTMLParser):
    """The texts of a page's cells, and how its tags are nested."""

    def __init__(self, page):
        super().__init__()
        self.cells, self.open = [], []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.cells.append(data)


def test_notebooks_show_a_table():
    page = Cells(fj.scenes.oblique_impact()._repr_html_())
    assert page.open == []
    assert page.cells[0] == "Scene"
    at = page.cells.index("thickness")
    assert page.cells[at + 1] == "45 mm"
    # Text is text: no tag of its own gets through.
    sheet = fj.parts.DataSheet("<b>", fj.Material())
    assert "<b>" not in sheet._repr_html_()


def test_printing_leaves_a_traced_program_as_it_is():
    texts = []

    def speed_of_sound(thickness, text):
        fence = fj.Fence(thickness=thickness)
        if text:
            texts.extend([repr(fence), fence._repr_html_(), repr(jax.tree.map(lambda x: x, fence))])
        return fence.stiffness_scale

    plain, printed = (
        jax.make_jaxpr(lambda h, text=text: jax.grad(speed_of_sound)(h, text))(0.045)
        for text in (False, True)
    )
    assert str(plain) == str(printed)
    assert "thickness=f64[]" in texts[0]


def test_printing_is_told_of_trees_that_are_no_parts_any_more():
    fence = fj.Fence()
    shapes = jax.eval_shape(lambda: fence)
    assert "thickness=f64[]" in repr(shapes)
    assert "thickness=0" in repr(jax.tree.map(lambda _: 0, fence))
    assert repr(eqx.filter(fence, lambda _: False)).startswith("Fence(")
    lanes = jax.vmap(lambda h: fj.Fence(thickness=h))(jnp.linspace(0.01, 0.09, 20))
    assert "thickness=f64[20], 10 mm ... 90 mm" in repr(lanes)


def test_printing_does_not_bear_on_structure_or_equality():
    one, other = fj.Fence(thickness=0.045), fj.Fence(thickness=0.05)
    assert jax.tree.structure(one) == jax.tree.structure(other)
    assert hash(jax.tree.structure(one)) == hash(jax.tree.structure(other))
    assert len(jax.tree.leaves(one)) == 7


# ---- gradients


def test_a_gradient_has_no_units_of_parts_and_gets_its_own():
    fence = fj.Fence()
    slope = jax.grad(lambda f: f.mass_scale)(fence)
    # rho z h l: the derivative in h is the mass over h.
    own = repr(slope)
    assert "mm" not in own
    assert "fj.Gradient" in own
    mass = float(fence.mass_scale)
    found = fj.Gradient(slope, fence, of="mass scale", unit="kg")
    assert found["thickness"] == pytest.approx(mass / 0.045, rel=1e-12)
    # At a constant ratio of the lengths, l grows with the reach.
    assert found["material.density"] == pytest.approx(mass / 1130.0, rel=1e-12)
    printed = repr(found)
    assert f"thickness         {mass / 45:.4g} kg per mm; 1 % more: {0.01 * mass:.4g} kg" in printed
    assert "none in" in printed
    assert "youngs_modulus" in printed.partition("none in")[2]
    with pytest.raises(ValueError, match="structure and shapes"):
        fj.Gradient(slope.material, fence)
    scene = fj.scenes.rigid_wall()
    by_scene = fj.Gradient(jax.tree.map(jnp.ones_like, scene), scene, of="peak_force")
    assert by_scene.unit == "N"
    assert "speed" in repr(by_scene)
    assert "N per m/s" in repr(by_scene)


# ---- settings and outcomes


@pytest.mark.parametrize("rung", ["coarse", "fast", "standard", "reference"])
def test_a_fidelity_prints_the_call_that_makes_it(rung):
    make = getattr(fj.Fidelity, rung)
    assert repr(make()) == f"Fidelity.{rung}()"
    changed = make(tip_fade=1e-2)
    assert repr(changed) == f"Fidelity.{rung}(tip_fade=0.01)"
    for one in (make(), changed, make(step=1.7e-4, modes=None)):
        assert eval(repr(one), {"Fidelity": fj.Fidelity}) == one


def test_an_optimum_says_what_decides_and_what_it_costs():
    # min 1000 (1 + (x - 1)^2 + y), x <= 0.9: d/dx = -200 there, and 1000 in y at y >= 0.
    def problem(z):
        force = 1000 * (1 + (z[0] - 1) ** 2 + z[1])
        return force[None], jnp.stack([z[0] - 0.3, 0.9 - z[0]]), jnp.zeros(1)

    optimum = fj.minimize(problem, [0.5, 0.5])
    printed = repr(optimum)
    assert "all limits hold" in printed
    assert "1750 at the start, 1010 found" in printed
    assert "margin 0 limits the design" not in printed
    assert "margin 1 limits the design             2 saved for each 1 % it is relaxed by" in printed
    space = fj.DesignSpace(["thickness", "reach"])
    text = repr(optimum.summary(space, ("clearance", "torque"), "N"))
    assert "1010 N found" in text
    text = " ".join(text.split())
    assert "lower bound of reach limits the design 10 N saved for each 1 % of the range" in text
    assert "torque limits the design 2 N saved for each 1 % it is relaxed by" in text
    # For a limit the text says what 1 % is: of its bound or, as here, of its scale.
    limits = (fj.Limit(fj.OBJECTIVES["tip_deflection"], 0.08), fj.LIMITS["crossing"])
    assert (limits[1].bound, limits[1].scale) == (0, 0.7)
    text = " ".join(repr(optimum.summary(space, limits, "N")).split())
    assert "limits the design 2 N saved for each 7 mm it is relaxed by" in text
    with pytest.raises(ValueError, match="must name the 2 margins and 2 variables"):
        optimum.summary(space, ("clearance",))


def test_a_result_prints_what_was_asked_for():
    wall = fj.scenes.rigid_wall()
    text = str(fj.simulate(wall, only=("energy", "final", "contact_time")))
    assert "contact_time" in text
    assert "energy.residual" in text
    assert "peak" not in text


def test_results_sorters_and_spaces_print_themselves():
    result = fj.simulate(fj.scenes.rigid_wall(duration=0.02), history=False)
    assert repr(result).startswith("Result\n")
    assert f"{float(result.peak_force):.2f} N" in repr(result)
    assert repr(jax.eval_shape(lambda: result)) == "Result(traced)"
    assert "parcel_kinetic=" in repr(result.energy)
    sorter = fj.Sorter(
        fence={"thickness": {"lower": "10 mm", "upper": "90 mm"}, "material": ["POM", "PA6 dry"]},
        parcels={"mass": ["2 kg", "30 kg"]}, limits={"tip_deflection": "60 mm"},
    )  # fmt: skip
    printed = repr(sorter)
    for text in (
        "free, 10 mm ... 90 mm", "POM, PA6 dry", "mass    2 kg ... 30 kg", "at most 60 mm",
        "worst peak_force", "speed=2 m/s",
    ):  # fmt: skip
        assert text in printed
    assert Cells(sorter._repr_html_()).open == []
    assert "thickness  10 mm ... 90 mm, logarithmic" in repr(fj.DesignSpace(["thickness"]))
    assert repr(fj.LIMITS["peak_stress"]) == "peak_stress at most 40 MPa"


def test_everything_that_prints_itself_has_a_page():
    # A class with text of its own in a terminal has the same in a notebook.
    for kind in (fj.Fence, fj.Result, fj.Optimum, fj.Sorter, SweepTable, fj.Fidelity, fj.Gradient):
        assert issubclass(kind, Readable)


def test_fits_choices_and_verifications_print_their_tables():
    def problem(z):
        return (1 + z[0])[None], jnp.stack([z[0] - 0.3]), jnp.zeros(1)

    optimum = fj.minimize(problem, [0.5])
    assert "confirmed" in repr(fj.verify(problem, optimum))
    time = np.linspace(0.0, 0.01, 30)
    scene = fj.scenes.rigid_wall(duration=0.011)
    recording = fj.recording.Recording(time, {"force": 3294 * np.sin(np.pi * time / 0.01) ** 2})
    fit = fj.identify.fit(fj.study.Experiment(scene, recording), ["stiffness"], most=3)
    assert repr(fit).startswith("Fit\n  parameter")
    assert "stiffness" in repr(fit)
    assert Cells(fit._repr_html_()).open == []
