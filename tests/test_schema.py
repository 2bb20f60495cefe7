"""Reading what users write as TOML."""

import pytest

from hdvplan.errors import VehicleError
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
