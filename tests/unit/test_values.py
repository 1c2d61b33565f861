"""A value is compared, shown, copied and changed field by field, compiled or not."""

from __future__ import annotations

import copy
import pickle
from typing import final

import pytest

from hil.values import Value, fields_of, replace


@final
class Point(Value):
    __slots__ = ("x_m", "name")

    def __init__(self, x_m: float, name: str = "") -> None:
        self.x_m = x_m
        self.name = name


def test_values_are_equal_when_all_fields_are():
    assert Point(1.0, "a") == Point(1.0, "a")
    assert Point(1.0, "a") != Point(1.0, "b")
    assert Point(1.0) != (1.0, "")
    assert len({Point(1.0), Point(1.0)}) == 1


def test_a_value_shows_its_fields_by_name():
    assert repr(Point(1.5, "a")) == "Point(x_m=1.5, name='a')"


def test_a_replaced_field_leaves_the_old_value_as_it_was():
    old = Point(1.0, "a")
    assert replace(old, x_m=2.0) == Point(2.0, "a")
    assert old == Point(1.0, "a")


def test_an_unknown_field_is_refused():
    with pytest.raises(TypeError, match="Point has no field y_m"):
        replace(Point(1.0), y_m=2.0)


@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, lambda v: pickle.loads(pickle.dumps(v))]
)
def test_a_copy_is_equal(again):
    assert again(Point(1.0, "a")) == Point(1.0, "a")


def test_the_fields_stand_in_the_order_of_the_arguments():
    assert fields_of(Point) == ("x_m", "name")
