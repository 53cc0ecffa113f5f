"""docs/gallery.md shows every pane of the screen, and what it shows is there."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

from tests.tui.fakes import bench_project
from trcvtui.tui.main import MainScreen
from trcvtui.tui.view_model.view_model import ViewModel

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
MOST_BYTES = 4_000_000


def make_pictures() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_pictures", DOCS / "make_pictures.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_pane_and_every_screen_is_in_the_gallery() -> None:
    screen = MainScreen(ViewModel(bench_project()), lambda line: None)
    panes = {pane.id for pane in (screen.instances, *screen._panes().values())}
    screens = {path.parent.name for path in (ROOT / "trcvtui" / "tui").glob("*/screen.py")}
    assert len(panes) == 8 and screens == {"lab", "scenarios"}
    screens |= {"main", "framings", "help", "description", "yank", "fleet"}
    shown = {pane for picture in make_pictures().SHOWN for pane in picture.shows}
    assert (panes | screens) - shown == set(), "draw it in docs/make_pictures.py"


def test_the_page_is_what_the_list_says() -> None:
    page = (DOCS / "gallery.md").read_text(encoding="utf-8")
    assert page == make_pictures().gallery_page(), "run `make pictures`"


def test_what_is_drawn_is_there_and_nothing_else() -> None:
    module = make_pictures()
    for folder, pictures in ((module.GALLERY, module.SHOWN), (module.PICTURES, module.TOLD)):
        drawn = {f"{picture.name}.svg" for picture in pictures}
        assert len(drawn) == len(pictures)
        assert {path.name for path in folder.iterdir()} == drawn, "run `make pictures`"


def test_every_picture_is_named_in_a_page() -> None:
    pages = [(DOCS / "gallery.md"), (DOCS / "stories.md"), (ROOT / "README.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    module = make_pictures()
    names = [f"gallery/{p.name}.svg" for p in module.SHOWN] + [f"pictures/{p.name}.svg" for p in module.TOLD]
    assert [name for name in names if name not in text] == []


def test_the_pictures_are_small() -> None:
    sizes = [path.stat().st_size for path in (*DOCS.glob("gallery/*.svg"), *DOCS.glob("pictures/*.svg"))]
    assert 0 < sum(sizes) < MOST_BYTES


def test_the_moving_picture_of_the_readme_has_its_frames_no_script_and_less_than_600_kb() -> None:
    module = make_pictures()
    (moving,) = (picture for picture in module.TOLD if any(isinstance(m, module.Look) for m in picture.play))
    svg = (DOCS / "pictures" / f"{moving.name}.svg").read_text(encoding="utf-8")
    titles = [move.title for move in moving.play if isinstance(move, module.Look)]
    assert len(titles) >= 5 and all(title in svg.replace("&#160;", " ") for title in titles)
    assert svg.count("@keyframes") >= len(titles) and "<script" not in svg
    assert len(svg) < 600_000
    assert f"pictures/{moving.name}.svg" in (ROOT / "README.md").read_text(encoding="utf-8")
