"""A filter of messages. Each row is checked against a condition, which is written as for a trigger.

Examples: `weight > 3`, `STATUS=80C5`. A name without an instance is a member of DATA or a pin of
the filtered instance. A row has only the pins in `ROW_VALUES`. A condition on a missing value is false.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Final

from trcvtui.blocks.pins import Direction, Pin
from trcvtui.engine.trigger_watch import OPERATORS, ConditionText, read_comparison
from trcvtui.errors import UserError, mistake
from trcvtui.history.messages import MessageRow
from trcvtui.project.project import DataDecl, Project
from trcvtui.project.tables import expected_name, quote
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Node, PlacedLeaf, find_node

Filter = Callable[[MessageRow], bool]

FILTER_FORM: Final = "weight > 3, STATUS=80C5 or RCVD_LEN!=12"
DATA_PREFIX: Final = "data"  # before a member that is called like a column or a pin
MOST_NAMES: Final = 1024  # that are compared with an unknown one
# By the field of Outcome; -1: the row lacks it.
ROW_VALUES: Final[Mapping[str, Callable[[MessageRow], int]]] = {
    "status": lambda row: row.status,
    "rcvd_len": lambda row: row.size,
    "done": lambda row: not row.reason,
}
# Names of columns are accepted too.
_RCVD_LEN: Final = Pin("RCVD_LEN", Direction.OUT, "UDINT", "", shows="rcvd_len")
_COLUMN_PINS: Final = (
    Pin("length", Direction.OUT, "UDINT", "", shows="rcvd_len"),
    Pin("status", Direction.OUT, "WORD", "", shows="status"),
)


def read_filter(text: str, project: Project, instance: str, where: str = "filter") -> Filter:
    """Return the filter for the rows of an instance; raise UserError for a wrong condition."""
    decl = project.instance(instance)
    assert decl is not None
    comparison = read_comparison(text.strip(), where, FILTER_FORM)
    named, _, rest = comparison.subject.partition(" ")
    if rest and project.instance(named) is not None:
        if named != instance:
            raise mistake(where, quote(named), instance)
        comparison = comparison._replace(subject=rest.strip())
    pins = [pin for pin in project.pins(decl.block) if pin.direction is Direction.OUT]
    return _make_filter(comparison, instance, pins, project.received_data(instance))


def read_layout_filter(text: str, layout: Layout | None, where: str = "filter") -> Filter:
    """Return the filter for messages without a project. `layout` is the type of the messages, or None."""
    return _make_filter(read_comparison(text.strip(), where, FILTER_FORM), "", (_RCVD_LEN,), layout)


def _make_filter(
    comparison: ConditionText, instance: str, outputs: Iterable[Pin], data: DataDecl | Layout | None
) -> Filter:
    subject, where = comparison.subject, comparison.where
    layout = data.layout if isinstance(data, DataDecl) else data
    pins = {pin.name: pin for pin in outputs if pin.shows in ROW_VALUES}
    found = find_member(layout, subject, *path_prefixes(instance, data)) if subject not in pins else None
    if found is not None and layout is not None:
        if not isinstance(found[1], PlacedLeaf):
            raise mistake(where, f"'{subject[:60]}', which has members of its own", "the path of one of them")
        condition = comparison.make_leaf_condition("", layout, layout.leaf(found[0]))
        return lambda row: row.content is not None and condition.holds_in(row.content[: row.have])
    known = {pin.name.casefold(): pin for pin in (*_COLUMN_PINS, *pins.values())} | pins
    pin = known.get(subject) or known.get(subject.casefold())
    if pin is None:
        leaves = layout.leaves(0, MOST_NAMES) if layout is not None else ()
        names = [*(each.name for each in _COLUMN_PINS), *pins, *(leaf.path for leaf in leaves if leaf.path)]
        raise unknown_member_error(where, subject, names)
    of_row, compare = ROW_VALUES[pin.shows], OPERATORS[comparison.operator]
    value = comparison.make_pin_condition(instance, pin).value
    return lambda row: (now := of_row(row)) >= 0 and compare(now, value)


def path_prefixes(instance: str, data: DataDecl | Layout | None) -> tuple[str, ...]:
    """Return instance and DATA, which may precede a member's path. Return () if `data` is no DataDecl."""
    return (instance, data.name) if isinstance(data, DataDecl) else ()


def find_member(layout: Layout | None, name: str, *before: str) -> tuple[int, Node] | None:
    """Return the number of the first leaf at a path and the node there. Without a node there, return None.

    The path may begin with `data`, the type's name or one of `before`.
    In a type with only one value, any of these beginnings can be the whole path.
    """
    if layout is None or not layout.leaf_count:
        return None
    paths = [name[len(start) :] for start in (DATA_PREFIX, layout.name, *before) if name.startswith(start)]
    for path in (name, *(path for path in paths if not path or path[0] in ".[")):
        try:
            return find_node(layout.root, path)
        except LookupError:
            continue
    return None


def unknown_member_error(where: str, name: str, names: Iterable[str]) -> UserError:
    """Return the error for a name that is no member; it suggests the nearest name."""
    return mistake(where, quote(name), expected_name(name, names, "member"), "unknown")
