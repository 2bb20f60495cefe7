"""Reading what users write as TOML, and errors that pass between processes with all that they say."""

import copy
import pickle
import traceback

import pytest

from hdvplan import errors
from hdvplan.errors import HdvplanError, VehicleError
from hdvplan.schema import parse_toml
from hdvplan.vehicle.load import parse_vehicle


@pytest.mark.parametrize("text", ["a = {}", "a = [1, {}]", "[[b]]\nc = {{ d = {} }}"])
def test_an_integer_that_no_message_can_print_is_refused_wherever_it_stands(text: str) -> None:
    huge = "0x" + "f" * 5000  # Python prints no integer of more than 4,300 digits: a refusal further on would end in its error
    with pytest.raises(ValueError, match=r"[ad] is too large a number"):
        parse_toml(text.format(huge))
    assert parse_toml(text.format(2**63 - 1))


def test_a_text_nested_too_deeply_is_refused() -> None:
    with pytest.raises(ValueError, match="nested too deeply"):
        parse_toml("a = " + "[" * 100_000)


def test_an_entry_of_a_table_below_is_told_its_place() -> None:
    with pytest.raises(VehicleError, match="unknown entry 'length'") as refused:
        parse_vehicle("length = 12.0\n[[unit]]\nwheelbase = 6.0\n", default_name="long")
    assert refused.value.hint == "it is an entry of [[unit]]"


ERRORS = (
    HdvplanError("no", hint="try"),
    errors.RoadError("no road", s_m=1.5, hint="try"),
    errors.ProjectionError("no foot", s_m=2.5, offset_m=30.0),
    errors.EntryError("no entry", field="name", hint="try"),
    errors.VehicleError("no vehicle", field="width", hint="try"),
    errors.OptionError("no option", hint="try"),
    errors.QpDataError("no program", hint="try"),
    errors.SolverError("no solution", status="lost", hint="try"),
    errors.PlanError("no plan", s_m=3.5, hint="try"),
    errors.TurnError("no turn", radius_m=9.0, least_radius_m=10.5, hint="try"),
    errors.MeasurementError("no measurement", hint="try"),
)


def kinds(root: type[HdvplanError]) -> set[type[HdvplanError]]:
    """Return a class of errors and all below it that are the package's own module's."""
    below = (kinds(kind) for kind in root.__subclasses__() if kind.__module__ == errors.__name__)
    return {root}.union(*below)


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_passes_between_processes_with_all_that_it_says(error: HdvplanError) -> None:
    for passed in (pickle.loads(pickle.dumps(error)), copy.copy(error)):  # noqa: S301 - our own bytes
        assert type(passed) is type(error)
        assert (str(passed), vars(passed)) == (str(error), vars(error))


def test_a_traceback_ends_with_the_hint() -> None:
    assert traceback.format_exception_only(errors.RoadError("too narrow", hint="--half-width 3"))[1:] == ["hint: --half-width 3\n"]
    assert len(traceback.format_exception_only(errors.RoadError("too narrow"))) == 1


def test_no_kind_of_error_is_left_out_of_that() -> None:
    assert {type(error) for error in ERRORS} == kinds(HdvplanError)
