"""The identity of a sweep: every number and choice of its setting, the code of a user's own
measures and parts, and the package itself."""

import dataclasses
import inspect
import json
import subprocess
import sys

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from variants import variants

import fencejax as fj
from fencejax import Fidelity
from fencejax.design import drivability
from fencejax.results import Measure
from fencejax.study import Lane, SceneFamily, Sweep, run_sweep, sampling


def spin_of(sample):
    return jnp.abs(sample.body.spin)


def value_of(state):
    return state.value


SPIN = fj.results.accumulators.peak_of("fling", spin_of)
FLING = Measure("fling", "rad/s", "", "at least 0", SPIN, value_of)
MOTOR = fj.Motor(400.0, 200.0, 300.0, 900.0, 1e-4, 10.0, 0.9, at_shaft=True)
SETTING = {
    "kind": "border_and_fence",
    "names": ("mass", "distance"),
    "fixed": {"drive_angle": 0.12},
    "fence": fj.Fence(taper=fj.PowerTaper(0.5)),
    "drive": fj.SplineDrive([0.1, 0.2, 0.3]),
    "parcel": fj.Parcel(height=0.2),
    "belt": fj.Belt(edge=True),
    "fence_friction": fj.Friction(0.3, 0.4),
    "border": fj.Border(),
    "motor": MOTOR,
    "duration": 0.2,
    "options": {"fence_corner": 2, "fence_corners": (1, 2)},
}
# What only some texts can be.
CHOSEN = {"kind": ["along_fence"], "names": [("mass", "length"), ("distance", "mass"), ("mass",)]}


def lane(setting=None, **changes):
    names = ("peak_force", "final.x", "fling")
    made = Lane(SceneFamily(**(setting or SETTING)), names, "fling", Fidelity.fast(), (FLING,))
    return dataclasses.replace(made, **changes)


def identity_of(one):
    return json.dumps(one.describe(), sort_keys=True)


def test_every_number_and_choice_of_a_setting_makes_another_sweep():
    assert {"self", *SETTING} == {*inspect.signature(SceneFamily.__init__).parameters}
    found = {"": identity_of(lane())}
    for name, value in SETTING.items():
        others = [(name, other) for other in CHOSEN.get(name, ())] or variants(value, name)
        for index, (path, other) in enumerate(others):
            setting = SETTING | {name: other} | ({"options": {}} if name == "kind" else {})
            found[f"{index} {path}"] = identity_of(lane(setting))
    whole = lane()
    for field in dataclasses.fields(Lane):
        if field.name != "family":
            for path, other in variants(getattr(whole, field.name), field.name):
                found[path] = identity_of(lane(**{field.name: other}))
    alike = [path for path, one in found.items() if path and one == found[""]]
    assert alike == []
    assert len(set(found.values())) == len(found)
    # All parts have been gone through, the motor's inertia among them.
    assert len(found) > 100
    assert any("motor.rotor_inertia" in path for path in found)
    assert found[""] == identity_of(lane())


def test_the_samples_and_the_precision_make_another_sweep():
    family = SceneFamily("oblique_impact", ["mass"])
    one, *others = (
        json.dumps(Sweep(family, sampling.given({"mass": values})).describe())
        for values in ([1.0, 2.0], [1.0, np.nextafter(2.0, 3)], [2.0, 1.0])
    )
    assert one not in others


def swept(folder, sweep):
    return run_sweep(sweep, folder, chunk=2, group=2)


def rigid(names=("mass",), outputs=("peak_force",), measures=(), **parts):
    """Two impacts of a rigid fence."""
    samples = sampling.given({name: [5.0, 15.0] for name in names})
    family = SceneFamily("oblique_impact", samples.names, duration=0.02, **parts)
    return Sweep(family, samples, outputs, fidelity=Fidelity.coarse(modes=0), measures=measures)


def test_motors_of_other_inertia_give_other_numbers(tmp_path):
    """In one process, and not in the folder of the first."""
    torque = fj.objectives.measures([drivability.MOTOR_TORQUE])
    found = []
    for inertia in (1e-4, 1e-1):
        motor = fj.Motor(400.0, rotor_inertia=inertia, gear_ratio=10.0)
        sweep = rigid(outputs=("motor_torque",), measures=torque, motor=motor)
        if found:
            with pytest.raises(ValueError, match="parts.motor.rotor_inertia is 0.0001 there"):
                swept(tmp_path / "0", sweep)
        found.append(swept(tmp_path / str(len(found)), sweep).outputs["motor_torque"])
    assert np.all(np.abs(found[1] - found[0]) > 0.1)


def scaled(factor):
    """Measures of one name, of functions of one name."""

    def read(state):
        return factor * state.value

    return Measure("scaled", "N", "", "at least 0", fj.results.accumulators.FORCE, read)


def test_measures_of_one_name_give_their_own_numbers(tmp_path):
    found = []
    for factor in (1.0, 2.0):
        sweep = rigid(outputs=("scaled",), measures=(scaled(factor),))
        if found:
            with pytest.raises(ValueError, match=r"measures\[0\].read.code is .* Choose another"):
                swept(tmp_path / "0", sweep)
        found.append(swept(tmp_path / str(len(found)), sweep).outputs["scaled"])
    np.testing.assert_allclose(found[1], 2 * found[0], rtol=1e-12)
    # The same code, made anew, is the same sweep.
    again = swept(tmp_path / "0", rigid(outputs=("scaled",), measures=(scaled(1.0),)))
    np.testing.assert_array_equal(again.outputs["scaled"], found[0])


def own_taper(power):
    """Tapers of one name."""

    class Own(fj.AbstractTaper):
        least: float = eqx.field(static=True, default=0.5)

        def __call__(self, place):
            return 1 - self.least * place**power

    return Own()


def own_drive(factor):
    """Drives of one name."""

    class Own(fj.HarmonicDrive):
        def motion(self, time):
            return super().motion(factor * time)

    return Own()


@pytest.mark.parametrize(("part", "make"), [("drive", own_drive), ("taper", own_taper)])
def test_parts_of_one_name_are_distinguished(part, make):
    def described(value):
        parts = {"drive": value} if part == "drive" else {"fence": fj.Fence(taper=value)}
        return json.dumps(lane(SETTING | parts).describe())

    assert described(make(1.0)) == described(make(1.0))
    assert described(make(1.0)) != described(make(2.0))


def test_parts_without_an_identity_are_refused_in_one_line(tmp_path):
    file = (tmp_path / "file").open("w")
    read = Measure("own", "1", "", "", FLING.accumulator, lambda state: file and state.value)
    with pytest.raises(ValueError, match="`measures` must be made of .* but holds an obj") as no:
        swept(tmp_path / "sweep", rigid(outputs=("own",), measures=(read,)))
    assert "\n" not in str(no.value)
    assert not (tmp_path / "sweep").exists()
    file.close()


def test_numbers_of_another_edition_are_refused_in_one_line(tmp_path, monkeypatch):
    swept(tmp_path, rigid())
    monkeypatch.setattr("fencejax.study.sweep.edition", lambda: "0.0.1, source 0123456789ab")
    text = 'fencejax is ".*" there and "0.0.1, source 0123456789ab" here. Choose another folder'
    with pytest.raises(ValueError, match=text) as refused:
        swept(tmp_path, rigid())
    assert "\n" not in str(refused.value)


PICKLED = """
import sys
import jax
jax.config.update("jax_enable_x64", True)
import cloudpickle, jax.numpy as jnp, fencejax as fj
from fencejax.results import MEASURES
from fencejax.study import Lane, SceneFamily
from fencejax.study.sweep_store import digest

SLOW = 0.5

def slowed(time):
    return SLOW * time

class Own(fj.HarmonicDrive):
    \"\"\"A drive of a user's own.\"\"\"

    def motion(self, time):
        return super().motion(slowed(time))

peak = fj.results.accumulators.peak_of("fling", lambda sample: jnp.abs(sample.body.spin))
fling = fj.Measure("fling", "rad/s", "", "at least 0", peak, lambda state: SLOW * state.value)
family = SceneFamily("oblique_impact", ["mass"], drive=Own())
lane = Lane(family, ("fling",), None, fj.Fidelity.fast(), (fling,))
open(sys.argv[1], "wb").write(cloudpickle.dumps(lane))
print(digest(lane.describe()))
"""

READ = """
import sys
import jax
jax.config.update("jax_enable_x64", True)
import pickle
from fencejax.study.sweep_store import digest

print(digest(pickle.load(open(sys.argv[1], "rb")).describe()))
"""


def test_a_worker_tells_what_is_sent_to_it_as_its_sender_does(tmp_path):
    sent = tmp_path / "lane"
    (tmp_path / "script.py").write_text(PICKLED)
    first, second = (
        subprocess.run(
            [sys.executable, *command, str(sent)], check=True, capture_output=True, text=True
        ).stdout
        for command in ([str(tmp_path / "script.py")], ["-c", READ])
    )
    assert len(first) == 65
    assert first == second
