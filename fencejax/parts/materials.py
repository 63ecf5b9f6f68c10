"""Materials that fences are made of: elasticity, density, damping and strengths, by name.

The numbers are typical of the class of product named, at the temperature and moisture stated, and
stand for a first design: put those of the supplier's own data sheet in their place
(`DataSheet(...)`, or a table of numbers in a sorter file) before anything is built. By rule:

- the allowed static stress is half the yield stress, or a third of the strength of what breaks
  without yielding;
- the fatigue strength is the amplitude of a fully reversed bending stress that 1e7 cycles do not
  break. Where no measured curve is named it is a quarter of the yield stress, the lower end of what
  plastics hold (a third to a quarter of the static strength: DIC, PPS technical information
  TSD-1003, 2008);
- the exponent m of Basquin's line, N sigma_a^m = constant, is that of the straight line in log N
  and log sigma_a from the static strength at half a cycle to the fatigue strength
  (`basquin_exponent`), where no other source is named. The static strength is the yield stress of
  plastics and the tensile strength of metals;
- the damping ratio is half the loss factor tan delta, of the material alone, at some 10 Hz. A
  bolted fence damps more: joints add 0.01 to 0.05.

>>> fj.materials.named("POM")
DataSheet(
  name='POM',
  material=Material(
    youngs_modulus=2.8 GPa,
    density=1410 kg/m^3,
    damping_ratio=0.01,
    fatigue_exponent=12.26,
  ),
  allowed_stress=33 MPa,
  fatigue_strength=17 MPa,
  conditions='23 C, any moisture',
)
"""

import difflib
import math
import re
from collections.abc import Callable, Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, ArrayLike

from .. import _check
from .._check import Bounds
from ..printing import Part
from .material import Material

ENDURANCE = 1e7
"""The cycles [1] that `DataSheet.fatigue_strength` is given for."""
EXPONENT = 10.0
"""m [1] of Basquin's line where a material's own is not known: that of glass laminates with epoxy
(Germanischer Lloyd, Guideline for the certification of wind turbines, 2010, 5.5.3.3), less than the
lines of most plastics and metals have. Where all amplitudes are below the fatigue strength the
least exponent is on the safe side."""


def basquin_exponent(
    static_strength: float, fatigue_strength: float, cycles: float = ENDURANCE
) -> float:
    """m = ln(2 N) / ln(S / sigma_D) [1] of the line N sigma_a^m = constant that goes through the
    static strength S [Pa] at half a cycle, the one load that breaks, and through the amplitude
    sigma_D [Pa] that N cycles do not break.

    >>> f"{fj.materials.basquin_exponent(65e6, 17e6):.2f}"
    '12.53'
    """
    return math.log(2 * cycles) / math.log(static_strength / fatigue_strength)


class DataSheet(Part):
    """A material with what it bears, and under which conditions.

    >>> sheet = fj.materials.pet()
    >>> f"{sheet.allowed_stress / 1e6:.0f} MPa", sheet.conditions
    ('42 MPa', '23 C, any moisture')
    """

    name: str = eqx.field(static=True)
    material: Material
    allowed_stress: Array | None
    fatigue_strength: Array | None
    conditions: str = eqx.field(static=True)

    bounds: ClassVar[dict[str, Bounds]] = {
        "allowed_stress": Bounds("Pa", above=0, size=1e7),
        "fatigue_strength": Bounds("Pa", above=0, size=1e7),
    }

    def __init__(
        self,
        name: str,
        material: Material,
        allowed_stress: ArrayLike | None = None,
        fatigue_strength: ArrayLike | None = None,
        conditions: str = "",
    ):
        """**Arguments:**

        - `name`: what it is called.
        - `material`: Young's modulus, density, damping ratio and fatigue exponent, differentiable.
        - `allowed_stress` [Pa]: the largest static bending stress, above 0.
        - `fatigue_strength` [Pa]: amplitude of a reversed bending stress that 1e7 cycles do not
          break, above 0. Both may be `None`, not known.
        - `conditions`: temperature and moisture for which the numbers hold.
        """
        self.name = name
        self.material = _check.part("material", material, Material, "material=fj.Material()")
        self.allowed_stress = self.fatigue_strength = None
        if allowed_stress is not None:
            self.allowed_stress = _check.field(self, "allowed_stress", allowed_stress)
        if fatigue_strength is not None:
            self.fatigue_strength = _check.field(self, "fatigue_strength", fatigue_strength)
        self.conditions = conditions


def _with(
    youngs_modulus: float, density: float, damping_ratio: float, static: float, fatigue: float
) -> Material:
    """A material whose exponent is that of its static and its fatigue strength [Pa]."""
    return Material(youngs_modulus, density, damping_ratio, basquin_exponent(static, fatigue))


def pa6_dry() -> DataSheet:
    """Polyamide PA6, cast or extruded, as dry as moulded (below 0.2 % of water), 23 C.

    E 3.0 GPa, yield 80 MPa, 1130 kg/m^3: data sheets of semi-finished PA6. Fatigue: 19 MPa at 1e7
    cycles, reversed plane bending of nylon 6 at 60 % humidity (Toray, Amilan CM1017, technical
    data): a dry part holds more, but does not stay dry.

    >>> sheet = fj.materials.pa6_dry()
    >>> sheet.material
    Material(youngs_modulus=3 GPa, density=1130 kg/m^3, damping_ratio=0.012, fatigue_exponent=11.69)
    """
    return DataSheet("PA6 dry", _with(3.0e9, 1130.0, 0.012, 80e6, 19e6), 40e6, 19e6, "23 C, dry")


def pa6_conditioned() -> DataSheet:
    """Polyamide PA6 in equilibrium with air of 50 % humidity (about 3 % of water), 23 C.

    E 1.3 GPa, yield 45 MPa, 1140 kg/m^3: data sheets of PA6, conditioned by ISO 1110. Fatigue:
    19 MPa at 1e7 cycles (Toray, Amilan CM1017, technical data, 60 % humidity).

    >>> sheet = fj.materials.pa6_conditioned()
    >>> sheet.material
    Material(youngs_modulus=1.3 GPa, density=1140 kg/m^3, damping_ratio=0.05, fatigue_exponent=19.5)
    """
    material = _with(1.3e9, 1140.0, 0.05, 45e6, 19e6)
    return DataSheet("PA6 conditioned", material, 22e6, 19e6, "23 C, 50 % humidity")


def pa66_gf30() -> DataSheet:
    """Polyamide PA66 with 30 % of glass fibre, conditioned, 23 C.

    E 7.0 GPa, strength 125 MPa, 1370 kg/m^3: data sheets of conditioned PA66-GF30. Fatigue:
    41 MPa at 1e7 cycles, ASTM D671 (Plasco, Fatigue endurance of reinforced thermoplastics).

    >>> sheet = fj.materials.pa66_gf30()
    >>> sheet.material
    Material(youngs_modulus=7 GPa, density=1370 kg/m^3, damping_ratio=0.015, fatigue_exponent=15.08)
    """
    material = _with(7.0e9, 1370.0, 0.015, 125e6, 41e6)
    return DataSheet("PA66-GF30", material, 41e6, 41e6, "23 C, 50 % humidity")


def pom_c() -> DataSheet:
    """Polyacetal copolymer POM-C, extruded, 23 C; takes up hardly any water.

    E 2.8 GPa, yield 67 MPa, 1410 kg/m^3: data sheets of semi-finished POM-C. Fatigue: 17 MPa, a
    quarter of the yield stress.

    >>> sheet = fj.materials.pom_c()
    >>> sheet.material
    Material(
      youngs_modulus=2.8 GPa,
      density=1410 kg/m^3,
      damping_ratio=0.01,
      fatigue_exponent=12.26,
    )
    """
    material = _with(2.8e9, 1410.0, 0.01, 67e6, 17e6)
    return DataSheet("POM", material, 33e6, 17e6, "23 C, any moisture")


def uhmw_pe() -> DataSheet:
    """Polyethylene of ultra-high molecular weight (PE 1000), pressed, 23 C; takes up no water.

    E 0.75 GPa, yield 20 MPa, 930 kg/m^3: data sheets of PE 1000. Fatigue: 5 MPa, a quarter of the
    yield stress. It creeps: keep lasting loads far lower.

    >>> sheet = fj.materials.uhmw_pe()
    >>> sheet.material
    Material(youngs_modulus=750 MPa, density=930 kg/m^3, damping_ratio=0.04, fatigue_exponent=12.13)
    """
    material = _with(0.75e9, 930.0, 0.04, 20e6, 5e6)
    return DataSheet("UHMW-PE", material, 10e6, 5e6, "23 C, any moisture")


def pet() -> DataSheet:
    """Polyester PET, semi-crystalline, 23 C; takes up hardly any water.

    E 3.1 GPa, yield 85 MPa, 1390 kg/m^3: data sheets of semi-finished PET. Fatigue: 21 MPa, a
    quarter of the yield stress.

    >>> sheet = fj.materials.pet()
    >>> sheet.material
    Material(
      youngs_modulus=3.1 GPa,
      density=1390 kg/m^3,
      damping_ratio=0.006,
      fatigue_exponent=12.02,
    )
    """
    material = _with(3.1e9, 1390.0, 0.006, 85e6, 21e6)
    return DataSheet("PET", material, 42e6, 21e6, "23 C, any moisture")


def polycarbonate() -> DataSheet:
    """Polycarbonate PC, unfilled, 23 C; takes up hardly any water.

    E 2.35 GPa, yield 63 MPa, 1200 kg/m^3: data sheets of PC sheet. Fatigue: 5.5 MPa at 1e7 cycles,
    ASTM D671 (Plasco, Fatigue endurance of reinforced thermoplastics): tough, but not for long.

    >>> sheet = fj.materials.polycarbonate()
    >>> sheet.material
    Material(
      youngs_modulus=2.35 GPa,
      density=1200 kg/m^3,
      damping_ratio=0.005,
      fatigue_exponent=6.894,
    )
    """
    material = _with(2.35e9, 1200.0, 0.005, 63e6, 5.5e6)
    return DataSheet("PC", material, 31e6, 5.5e6, "23 C, any moisture")


def cast_pur() -> DataSheet:
    """Cast polyurethane elastomer of Shore hardness 75 D, 23 C, dry.

    E 0.55 GPa, tensile strength 45 MPa, yield about 25 MPa, 1200 kg/m^3: data sheets of cast
    polyether PUR of 70 to 75 D. Fatigue: 6 MPa, a quarter of the yield stress. Stiffness falls fast
    with temperature.

    >>> sheet = fj.materials.cast_pur()
    >>> sheet.material
    Material(
      youngs_modulus=550 MPa,
      density=1200 kg/m^3,
      damping_ratio=0.05,
      fatigue_exponent=11.78,
    )
    """
    material = _with(0.55e9, 1200.0, 0.05, 25e6, 6e6)
    return DataSheet("cast PUR", material, 12e6, 6e6, "23 C, dry")


def gfrp() -> DataSheet:
    """Glass fibre in polyester, pultruded, along the fibres, 23 C.

    E 23 GPa and bending strength 240 MPa are the least that EN 13706 asks of the class E23;
    1850 kg/m^3. Fatigue: 55 MPa, 23 % of that strength, as unidirectional E-glass laminates hold;
    exponent 9, of laminates with polyester (Germanischer Lloyd, Guideline for the certification of
    wind turbines, 2010, 5.5.3.3).

    >>> sheet = fj.materials.gfrp()
    >>> sheet.material
    Material(youngs_modulus=23 GPa, density=1850 kg/m^3, damping_ratio=0.005, fatigue_exponent=9)
    """
    material = Material(23e9, 1850.0, 0.005, 9.0)
    return DataSheet("GFRP", material, 80e6, 55e6, "23 C, any moisture")


def spring_steel() -> DataSheet:
    """Spring steel 51CrV4 (1.8159), quenched and tempered, 20 C.

    E 206 GPa, 7850 kg/m^3, yield 1200 MPa, strength 1350 MPa: EN 10089. Fatigue: 500 MPa, 0.37 of
    the strength, ground and without decarburised skin.

    >>> sheet = fj.materials.spring_steel()
    >>> sheet.material
    Material(
      youngs_modulus=206 GPa,
      density=7850 kg/m^3,
      damping_ratio=0.001,
      fatigue_exponent=16.93,
    )
    """
    material = _with(206e9, 7850.0, 0.001, 1350e6, 500e6)
    return DataSheet("spring steel", material, 600e6, 500e6, "20 C, kept from corrosion")


def aluminium() -> DataSheet:
    """Aluminium EN AW-7075 T6, 20 C.

    E 71 GPa, 2810 kg/m^3, yield 480 MPa, strength 540 MPa: EN 485-2. Fatigue: 159 MPa at 5e8 cycles
    (ASM Handbook, vol. 2), below what it holds for 1e7; the line's exponent is that to 5e8.

    >>> sheet = fj.materials.aluminium()
    >>> sheet.material
    Material(
      youngs_modulus=71 GPa,
      density=2810 kg/m^3,
      damping_ratio=0.001,
      fatigue_exponent=16.95,
    )
    """
    material = Material(71e9, 2810.0, 0.001, basquin_exponent(540e6, 159e6, 5e8))
    return DataSheet("aluminium", material, 240e6, 159e6, "20 C, kept from corrosion")


# A function each: arrays are made where a material is asked for, in the precision set then.
MATERIALS: Mapping[str, Callable[[], DataSheet]] = {
    "PA6 dry": pa6_dry,
    "PA6 conditioned": pa6_conditioned,
    "PA66-GF30": pa66_gf30,
    "POM": pom_c,
    "UHMW-PE": uhmw_pe,
    "PET": pet,
    "PC": polycarbonate,
    "cast PUR": cast_pur,
    "GFRP": gfrp,
    "spring steel": spring_steel,
    "aluminium": aluminium,
}
"""The function that makes each material, by the material's name."""


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]+", "", name).lower()


def known(name: str) -> bool:
    """Whether there is a material of a name.

    >>> fj.materials.known("PET"), fj.materials.known("oak")
    (True, False)
    """
    return _plain(name) in {_plain(each) for each in MATERIALS}


def named(name: str) -> DataSheet:
    """A material by its name, whatever its capitals, spaces, hyphens and underscores.

    Raises `ValueError` for a name that there is not, with the nearest one.

    >>> fj.materials.named("PET").conditions
    '23 C, any moisture'
    """
    known = {_plain(each): make for each, make in MATERIALS.items()}
    if isinstance(name, str) and _plain(name) in known:
        return known[_plain(name)]()
    titles = {_plain(each): each for each in MATERIALS}
    near = difflib.get_close_matches(_plain(str(name)), titles, 1, 0.3)
    meant = f" Did you mean {titles[near[0]]!r}?" if near else ""
    raise ValueError(
        f"Argument `material` must name one of {', '.join(MATERIALS)}, but is {name!r}.{meant}"
    )
