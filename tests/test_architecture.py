"""The promises of the house that a static graph cannot see."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "trcvtui"


def modules_after(statement: str) -> set[str]:
    """Return the names of the modules that a fresh interpreter has loaded after a statement."""
    code = f"{statement}\nimport sys\nprint('\\n'.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_the_headless_half_loads_no_screen_library() -> None:
    loaded = modules_after("import trcvtui.scenario.command, trcvtui.engine.driver, trcvtui.engine.engine")
    assert not {name for name in loaded if name.split(".")[0] in ("textual", "rich")}
    assert not {name for name in loaded if name.startswith("trcvtui.tui")}


def test_every_file_opens_with_its_duty() -> None:
    bare = [
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if not path.read_text(encoding="utf-8").startswith('"""')
    ]
    assert bare == []


def test_no_status_number_stands_outside_the_dialects() -> None:
    number = re.compile(r"\b0x[78]0[0-9A-Fa-f]{2}\b")
    strangers = [
        f"{path.relative_to(PACKAGE)}: {line.strip()}"
        for path in PACKAGE.rglob("*.py")
        if "dialects" not in path.parts
        for line in path.read_text(encoding="utf-8").splitlines()
        if number.search(line) and "help=" not in line
    ]
    assert strangers == []


def test_every_file_that_the_pages_for_contributors_name_is_there() -> None:
    named = re.compile(
        r"`((?:trcvtui/)?(?:bench|blocks|capture|cli|commands|diagnosis|dialects|docs|engine|fleet|history|line|net|picture|plc|project|recording|replay|report|scenario|snapshots|tests|tui|udt)/[\w./-]+)`"
    )
    missing = [
        f"{page}: {name}"
        for page in ("docs/architecture.md", "CONTRIBUTING.md")
        for name in named.findall((PACKAGE.parent / page).read_text(encoding="utf-8"))
        if not any(
            (root / (name + end)).exists() for root in (PACKAGE, PACKAGE.parent) for end in ("", ".py")
        )
        if "NAME" not in name
    ]
    assert missing == []


def test_no_two_classes_have_one_name() -> None:
    places: dict[str, list[str]] = defaultdict(list)
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{path.relative_to(PACKAGE)}:{node.lineno}")
    twice = {name: found for name, found in places.items() if len(found) > 1}
    assert twice == {}, "give the narrower one a name that tells it apart"


PARSERS = {"startswith", "endswith", "removeprefix", "removesuffix", "partition", "rpartition", "split"}
TOLD = {"detail", "reason", "why", "said", "told"}  # fields that hold a text of ours
BY_NAME = {"c_header.py", "c_parse.py"}  # makes classes; reads pycparser when there is a header
SAID_ONCE = {"advice.py"}  # a pin that the name of a cause says already is not said twice
PARSED = "parses a text that we have made: give the event a field for it, make the text in the view"
NAMED = "knows a class by its name: ask with isinstance, or let a table have the classes themselves as keys"


def is_our_text(node: ast.AST) -> bool:
    """Return whether this is a field that holds a text that we have made: it is for people."""
    if not isinstance(node, ast.Attribute):
        return False
    is_cause = ast.unparse(node.value).split(".")[-1] == "cause"
    return node.attr in TOLD or (node.attr == "name" and is_cause)


def is_parsed(node: ast.AST, path: Path) -> bool:
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        is_regex = isinstance(node.func.value, ast.Name) and node.func.value.id == "re"
        by_itself = node.func.attr in PARSERS and is_our_text(node.func.value)
        return by_itself or (is_regex and any(map(is_our_text, node.args)))
    if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.In | ast.NotIn):
        return is_our_text(node.comparators[0]) and path.name not in SAID_ONCE
    return False


def parsed_texts(package: Path) -> list[str]:
    """Return where a text of ours is parsed, or a class is known by its name as a string."""
    found = []
    for path in sorted(package.rglob("*.py")):
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        texts = [node for node in nodes if isinstance(node, ast.JoinedStr)]  # there a name is but told
        told = {id(part) for text in texts for part in ast.walk(text)}
        for node in nodes:
            is_name = isinstance(node, ast.Attribute) and node.attr == "__name__" and id(node) not in told
            is_known = is_name and path.name not in BY_NAME
            if isinstance(node, ast.expr) and (is_known or is_parsed(node, path)):
                found.append(
                    (f"{path.relative_to(package.parent)}", node.lineno, NAMED if is_known else PARSED)
                )
    return [f"{path}:{line} {what}" for path, line, what in sorted(found)]


def test_nobody_parses_a_text_of_ours_or_knows_a_class_by_its_name() -> None:
    assert parsed_texts(PACKAGE) == []


def test_a_parsed_text_is_told_with_its_place_and_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "house").mkdir()
    (tmp_path / "house" / "facts.py").write_text(
        "peer = event.detail.partition(': ')[0]\n"
        "is_gone = 'gone' in e.cause.name\n"
        "take = takers[type(event).__name__]\n"
        "told = f'{type(event).__name__} lets scans pass'\n"
    )
    found = parsed_texts(tmp_path / "house")
    assert [line.partition(" ")[0] for line in found] == [f"house/facts.py:{n}" for n in (1, 2, 3)]
    assert all(PARSED in line for line in found[:2])
    assert NAMED in found[2]
