"""Carrier feedback: the output turns the carrier, the carrier turns the planets around the held sun."""

from __future__ import annotations

from rverror.geartrain.mechanism import Reducer


def loop_gain(reducer: Reducer) -> float:
    """Share of an output error that returns to the output through the involute stage.

    A carrier that leads by Theta rolls the planets on the held sun; each crank turns by (1 + z1/z2) Theta against the
    housing, which turns the disc back by a z_c-th of it:

        g = -(1 + z1/z2) / z_c.

    Parameters
    ----------
    reducer : Reducer

    Returns
    -------
    float
        -0.0342 for the RV-40E.

    Notes
    -----
    Source 000 adds one such step with a positive sign and i2 = 41 ("1-2 arcsec"); the step lowers the error, and the
    loop has no last step.

    Examples
    --------
    >>> from rverror import reducer
    >>> round(loop_gain(reducer("RV-40E")), 6)
    -0.034188
    """
    return -(1 + reducer.sun_teeth / reducer.planet_teeth) / reducer.disc_lobes


def feedback_factor(reducer: Reducer) -> float:
    """Closed loop over open loop, F = 1 / (1 - g) = z_c (z2/z1) / R, the sum of all steps.

    It acts on all that moves the cranks against the housing (involute stage, cranks, cycloid mesh, disc bores), not on
    carrier bores, which move the carrier against the cranks.

    Parameters
    ----------
    reducer : Reducer

    Returns
    -------
    float
        117/121 for the RV-40E.

    Examples
    --------
    >>> from rverror import reducer
    >>> round(feedback_factor(reducer("RV-40E")) * 121, 9)
    117.0
    """
    return 1 / (1 - loop_gain(reducer))
