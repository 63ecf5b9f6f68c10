"""The truth for searches and promises: the same model, as fine as an acceptable time allows.

Two kinds. Fixed steps share no error control with what they judge. Steps that follow their error
put short ones where a parcel lets go of the belt: fixed ones let go in jumps, which is nothing
beside the force and much beside its derivatives.

Over which sliding speed static friction falls to kinetic is a number of the model: real pairs do so
over a millimetre a second and more (the usual 1 mm/s of the LuGre model: Canudas de Wit et al.,
IEEE Transactions on Automatic Control 40(3), 1995). A truth has the same, unless it is given
`SHARPER`, which tells what the peak owes to that number.
"""

import fencejax as fj

# Nearer to dry friction: that of `reference`, a fifth of what `standard` has.
SHARPER = fj.Fidelity.reference().smoothing._asdict()
# Tolerance of strides where nothing touches, a tenth of that of `standard`: at that of `coarse` and
# `fast`, 5e-3, they stepped over a parcel that came to rest on the belt, and a sort was off by 6 %.
_STRIDES = 1e-4


def fixed(fidelity: fj.Fidelity, step: float, **finer) -> fj.Fidelity:
    """The same by fixed steps, with `finer` knobs besides."""
    return fidelity.replace(step=step, step_tolerance=None, stride_tolerance=_STRIDES, **finer)


def following(fidelity: fj.Fidelity, share: int, **finer) -> fj.Fidelity:
    """The same by steps of 0.1 ms at most, 3 us at least, that follow their error to a tolerance
    `share` times as small as that of `standard`."""
    tolerance = fj.Fidelity.standard().step_tolerance
    assert tolerance is not None
    return fixed(fidelity, 1e-4, **finer).replace(step_tolerance=tolerance / share, halvings=5)
