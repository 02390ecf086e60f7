"""What `repr` and `print` show of a result: one short line; what its table tells of units."""

from __future__ import annotations

import pytest

import rverror
from every_kind import KINDS, every_kind
from modules import ROOMS
from rverror.base.viewed import OneLine

#: What has no line of its own: lists, and what is as short as it is written.
OTHERS = ("Drive", "Effects", "Efficiencies", "Front", "Tolerance", "Tolerances")
MODEL = rverror.Model(
    rverror.reducer("RV-40E"),
    (rverror.effect("crank.eccentricity", crank=0, disc=1, radial="5 um", tangential="-1 um"),),
)


@pytest.mark.parametrize("name", KINDS)
def test_a_result_is_one_short_line(name: str) -> None:
    thing = every_kind()[name][0]
    assert isinstance(thing, OneLine | rverror.Effect) is (name not in OTHERS)
    if name in OTHERS:
        return
    line = repr(thing)
    assert line == str(thing) or name == "Effect"
    assert "\n" not in line
    assert line.isprintable()
    assert len(line) <= 112
    assert line.startswith("<")


def test_lines_tell_what_it_is() -> None:
    assert repr(MODEL) == "<Model: RV-40E, R = 121, 1 effect>"
    assert repr(MODEL.mechanism) == "<Reducer: RV-40E, R = 121>"
    size = "crank.eccentricity (crank 0, disc 1): radial 5 um, tangential -1 um"
    assert (str(MODEL.effects[0]), repr(MODEL.effects[0])) == (size, f"<Effect {size}>")
    assert repr(MODEL.equilibrium("78 Nm", [0.1, 0.2])) == "<Equilibrium: 2 angles>"
    assert repr(rverror.statics.linearise(MODEL, 0.1)) == "<Linearisation: Equilibrium: 1 angle>"
    assert repr(rverror.simulate(MODEL, points=64)) == "<Run: 64 samples>"


def test_completion_lists_the_public_names_alone() -> None:
    assert set(dir(rverror)) == set(rverror.__all__) | set(ROOMS)
    assert {"transmission_error", "influence", "equilibrium", "angles", "plot"} <= set(dir(MODEL))


def test_tables_tell_the_unit_of_every_column() -> None:
    state = MODEL.equilibrium("78 Nm", [0.1, 0.2])
    for display, unit in ((True, "arcsec"), (False, "rad")):
        assert rverror.to_pandas(state, display=display).attrs["units"]["transmission_error"] == unit
        assert rverror.to_xarray(state, display=display)["transmission_error"].attrs["units"] == unit


def test_a_limit_with_a_unit_in_plots_and_texts() -> None:
    cams = [rverror.tolerance("crank.eccentricity", "5 um")]
    found = rverror.error_budget(MODEL, cams, count=256, index_count=64)
    limit = 60 * rverror.ARCSEC
    assert rverror.to_text(found, limit="60 arcsec") == rverror.to_text(found, limit=limit)
    assert rverror.to_json(found, limit="1 arcmin") == rverror.to_json(found, limit=60 * rverror.ARCSEC)
    assert found.units.yield_at("60 arcsec") == found.units.yield_at(limit)
    labels = [text.get_text() for text in found.plot(kind="distribution", limit="60 arcsec").get_legend().get_texts()]
    assert any(label.startswith("limit 60 arcsec") for label in labels)
    with pytest.raises(ValueError, match=r"limit: .*'N\*m' is no unit of angle"):
        found.units.yield_at("60 Nm")
