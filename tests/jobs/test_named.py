"""A user's own drive, taper, objective and limit, from a module outside the package."""

import importlib

import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from optimize.common import evaluations, named
from optimize.peak_force import main

MODULE = '''
import equinox as eqx
import jax.numpy as jnp

import fencejax as fj


class Wedge(fj.AbstractTaper):
    """g = 1 - share x / l_p."""

    share: object

    def __init__(self, share=0.4):
        self.share = jnp.asarray(share, dtype=float)

    def __call__(self, position, tip_distance):
        return 1 - self.share * position


class Straight(fj.AbstractTaper):
    """The same with a fixed share."""

    def __call__(self, position, tip_distance):
        return 1 - 0.4 * position


class Swing(fj.AbstractDrive):
    """The harmonic law by another formula, alpha = a sin(pi t / t_c)^2."""

    amplitude: object
    period: object

    def __init__(self, amplitude=0.66, period=1.36):
        self.amplitude = jnp.asarray(amplitude, dtype=float)
        self.period = jnp.asarray(period, dtype=float)

    def angle(self, time):
        inside = (time > 0) & (time < self.period)
        return jnp.where(inside, self.amplitude * jnp.sin(jnp.pi * time / self.period) ** 2, 0.0)

    @property
    def cycle(self):
        return self.period

    @property
    def turning_time(self):
        return 0.5 * self.period


KICK = fj.Quantity(
    "kick", "m/s", "impulse over the parcel's mass",
    lambda result, scene: result.impulse / scene.parcel.mass, fields=("impulse",),
)
FLING = fj.Measure(
    "fling", "rad/s", "largest spin of the parcel", "at least 0",
    fj.results.accumulators.peak_of("spin", lambda sample: jnp.abs(sample.body.spin)),
    lambda state: state.value,
)
SOFT = fj.Limit(fj.OBJECTIVES["impulse"], 300.0)
LOW = fj.Limit(fj.OBJECTIVES["peak_stress"], 30e6)
NUMBER = 3
'''


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """The module's name; it can be imported in this test alone."""
    name = "machine_of_a_user"
    (tmp_path / f"{name}.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield name
    monkeypatch.delitem(importlib.sys.modules, name, raising=False)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nowhere:Swing", "name a module that Python can import, but 'nowhere:Swing' does"),
        ("{m}:Sing", "'{m}:Sing' does not. It has "),
        ("{m}:Wedge", "name an instance of AbstractDrive.*'{m}:Wedge' makes a Wedge"),
        ("{m}:NUMBER", "'{m}:NUMBER' is a int"),
        ("swing", r"be one of \('harmonic', .* or module:Name, but is 'swing'"),
        (":Swing", "name a module"),
    ],
)
def test_what_is_none_is_refused(machine, text, message):
    with pytest.raises(ValueError, match="Argument `drive` must .*" + message.format(m=machine)):
        named.drive(text.format(m=machine))


def test_limits_of_the_same_quantity_replace_the_jobs(machine):
    jobs = (fj.LIMITS["tip_deflection"], fj.LIMITS["peak_stress"])
    found = named.limits(jobs, (f"{machine}:LOW", f"{machine}:SOFT"))
    assert [(limit.name, limit.bound) for limit in found] == [
        ("tip_deflection", 0.08), ("peak_stress", 30e6), ("impulse", 300.0),
    ]  # fmt: skip
    with pytest.raises(ValueError, match="`limit` must limit each quantity once"):
        named.limits(jobs, (f"{machine}:LOW", "peak_stress"))


OWN_PARTS = ["--drive", "{m}:Swing", "--taper", "{m}:Wedge"]
LIMITS = ["--limit", "{m}:SOFT"]


def configured(job, machine, arguments):
    configure = importlib.import_module(f"optimize.{job}.configuration").configure
    return configure([text.format(m=machine) for text in arguments])


@pytest.mark.parametrize("job", ["peak_force", "pareto", "robust_design", "co_design"])
def test_design_jobs_take_them(machine, job):
    own = OWN_PARTS if job != "co_design" else OWN_PARTS[2:]
    bounds = ["--free", "fence.taper.share=0.1:0.8"]
    config = configured(
        job, machine, [*own, *LIMITS, "--variables", "thickness", "fence.taper.share", *bounds]
    )
    assert type(config.space.fence.taper).__name__ == "Wedge"
    assert config.space.names == ("thickness", "fence.taper.share")
    fence, drive = config.space.apply([0.05, 0.3])
    assert fence.taper.share == 0.3
    assert type(drive).__name__ == ("SplineDrive" if job == "co_design" else "Swing")
    assert config.limits[-1].name == "impulse"
    if job != "peak_force":
        # Evaluations on file are another machine's.
        keys = {evaluations.key(configured(job, machine, text)) for text in ([], own[-2:], LIMITS)}
        assert len(keys) == 3


def test_a_sweep_keeps_a_measure_of_a_users_own(machine):
    text = ["--vary", "mass=5:15", "--outputs", "peak_force", "{m}:FLING", "--duration", "0.05"]
    sweep = configured("sweep", machine, [*text, "--gradient", "{m}:FLING"]).sweep()
    assert sweep.outputs == ("peak_force", "fling")
    assert sweep.columns["d_fling_d_mass"] == "(rad/s) / (kg)"
    found = sweep.lane(jnp.array([10.0]))
    scene = sweep.family.scene(jnp.array([10.0]))
    history = fj.simulate(scene, fidelity=sweep.fidelity, only=("history",)).history
    spin = history.body.spin
    # The vertex of a parabola through three samples of a smooth curve.
    assert float(found["fling"]) == pytest.approx(float(jnp.abs(spin).max()), rel=1e-3)
    assert sweep.lane.describe() != configured("sweep", machine, text).sweep().lane.describe()
    with pytest.raises(ValueError, match="Argument `outputs` must name an instance of Measure"):
        configured("sweep", machine, ["--vary", "mass=5:15", "--outputs", "{m}:NUMBER"]).sweep()


def test_other_jobs_take_them(machine):
    config = configured("pareto", machine, ["--against", "{m}:KICK"])
    assert config.quantity.unit == "m/s"
    with pytest.raises(ValueError, match="`against` must be one of"):
        configured("pareto", machine, ["--against", "kick"])
    varied = ["--vary", "fence.taper.share=0.1:0.8", "drive.amplitude=0.5:0.7"]
    sweep = configured("sweep", machine, [*OWN_PARTS, *varied]).sweep()
    scene = sweep.family.scene([0.3, 0.6])
    assert scene.fence.taper.share == 0.3
    assert scene.drive.amplitude == 0.6
    config = configured("sensitivity", machine, [*OWN_PARTS, "--outputs", "{m}:KICK"])
    config.check()
    assert type(config.base().drive).__name__ == "Swing"
    assert config.quantities()[0].name == "kick"


def test_peak_force_designs_a_users_machine(machine, tmp_path):
    config = configured("peak_force", machine, [
        "--drive", "{m}:Swing", "--taper", "{m}:Straight", "--objective", "{m}:KICK",
        "--limit", "{m}:SOFT", "--variables", "thickness", "--distances", "0.9", "--masses", "15",
        "--duration", "0.1", "--crossing", "-0.6", "--fidelity", "coarse", "--no-reference",
        "--sort-masses", "--budget", "3", "--no-plots", "--out", str(tmp_path),
    ])  # fmt: skip
    outcome = main(config, quiet=True)
    assert type(outcome.space.drive).__name__ == "Swing"
    measured = outcome.measured
    after, before = measured["after"], measured["before"]
    # One lane, by the optimiser's program and by that of the check: the same to rounding, which the
    # contact's start enlarges.
    np.testing.assert_allclose(measured["found"]["kick"], after["kick"], rtol=1e-6)
    np.testing.assert_allclose(15.0 * after["kick"], after["impulse"], rtol=1e-12)
    assert after["kick"] < before["kick"]
    assert '"kick"' in (tmp_path / "history.json").read_text()
