"""The source paper's stages of a sort, one module a stage, and their sequence, in NumPy and SciPy.

Source: T. Piatkowski, Active fence with flexible link, J. Theor. Appl. Mech. 48(1), 87-109, 2010;
equation numbers are the paper's, its misprints corrected.

    border_and_fence    corner 1 on the fence, corner 2 on the border, (2.31)-(2.34)
    along_fence         the lower wall on the fence, rotation tied to it, (2.27)-(2.30)
    free_motion         the belt alone
    sequence            one after the other, switched by events
    two_corners         no stage of the paper: the wall on the fence with its rotation left free,
                        to measure what the tie of (2.27) leaves out
    common              the beam under its loads, the foot on the fence, friction

The parcel's equations are those of `reference.polar`, the beam's modes those of
`reference.beam`, the chord-angle geometry of the fence and the parameters those of
`reference.impact` (`Impact` with `drive_angle` 0 puts time zero at the start of the swing).

Every stage is a module with `derivative(impact, time, state)`, `sample(impact, time, state)` and
events. A state vector holds the modal displacements eta and velocities eta', then
r, alpha_p, phi, r', alpha_p', phi' (`common.FREE`), or r, alpha_p, r', alpha_p' where the rotation
is tied (`common.TIED`). SI units throughout.
"""
