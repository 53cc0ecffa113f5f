"""What the README and the pages say works as it stands: commands, links, projects, examples."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tui.on_a_bench import LocalLooker, on_local
from trcvtui.cli.main import main
from trcvtui.scenario.scenario import load_bench_project

ROOT = Path(__file__).parents[1]
PAGES = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")}
README = (ROOT / "README.md").read_text(encoding="utf-8")
SIEMENS = PAGES["siemens.md"]
TESTED = ("blocks.md", "siemens.md", "twincat.md")  # whose `sh` blocks are run
COMMANDS = [
    line
    for page in TESTED
    for block in re.findall(r"```sh\n(.*?)```", PAGES[page], re.DOTALL)
    for line in block.splitlines()
    if line.strip()
]


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_the_readme_works(command: str) -> None:
    words = shlex.split(command)
    assert words[0] == "trcvtui"
    program = str(Path(sys.executable).with_name("trcvtui"))
    done = subprocess.run([program, *words[1:]], cwd=ROOT, capture_output=True, text=True, check=False)
    is_compared = words.count("--dialect") > 1  # there the expectations of one vendor fail in the other
    assert done.returncode == int(is_compared), done.stderr
    assert done.stdout and not done.stderr


def test_the_readme_is_short_and_each_command_that_it_names_exists() -> None:
    assert len(README.splitlines()) <= 150
    named = set(re.findall(r"[`|] ?trcvtui ([a-z]+)", README))
    assert {"run", "watch", "tap", "doctor", "status"} <= named
    for command in sorted(named):
        assert main([command, "--help"]) == 0, command


LINKING = [
    "README.md",
    "configs/README.md",
    *sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md")),
]


@pytest.mark.parametrize("page", LINKING)
def test_every_picture_and_page_that_a_page_links_is_there(page: str) -> None:
    path = ROOT / page
    links = re.findall(r"\]\(([^)#:]+)\)", path.read_text(encoding="utf-8"))
    assert links or page != "README.md"
    assert [link for link in links if not (path.parent / link).exists()] == []


def test_every_project_that_is_opened_in_the_readme_opens() -> None:
    projects = re.findall(r"trcvtui run (configs/\S+)$", README, re.MULTILINE)
    assert len(projects) == 2
    for project in projects:
        assert load_bench_project(ROOT / project).instances


async def test_the_lines_from_connect_to_verdict_do_and_show_what_they_say() -> None:
    section = README.partition("## A fault, from connect to verdict")[2].partition("\n## ")[0]
    steps = re.findall(r"^(?:\d\. |\*\*Verdict).*?(?=^\d\. |^$|\Z)", section, re.MULTILINE | re.DOTALL)
    assert len(steps) == 5
    async with on_local(
        LocalLooker, load_bench_project(ROOT / "configs/checkweigher.toml"), (100, 30)
    ) as looker:
        looker.bench.scan(20)
        await looker.see()
        for step in steps:
            for typed in re.findall(r"`([^`]+)`", step.replace("\n   ", " ")):
                if len(typed) == 1 or typed == "enter":
                    await looker.press({":": "colon"}.get(typed, typed))
                elif typed != "state":
                    await looker.type(typed)
                looker.bench.scan(20)
                await looker.see()
            shown = " ".join(re.sub("[│┃]", " ", looker.text).split())
            for words in re.findall(r"(?<!\*)\*([^*]+)\*(?!\*)", step):
                assert words in shown, (words, looker.text)
        (instance,) = looker.app.view_model.instances
        assert (instance.outputs.status, instance.have) == (0x7006, 0), "nothing is left of the short frame"


def test_every_make_target_of_the_readme_is_in_the_makefile() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^make (\w+)", README, re.MULTILINE))
    assert targets
    assert [target for target in targets if not re.search(rf"^{target}\b.*:", makefile, re.MULTILINE)] == []


def test_the_example_of_a_project_file_shows_a_living_bench_when_it_is_pasted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (toml,) = re.findall(r"```toml\n(.*?)```", PAGES["project-file.md"], re.DOTALL)
    (tmp_path / "bench.toml").write_text(toml, encoding="utf-8")
    steps = (
        "wait TRCV_C_1 STATUS=7008 within T#5s\\nexpect TRCV_C_1 trace 0001 7001 7002+ 7004+ 7006+ 7008\\n"
    )
    steps += "expect report hex 01 00 00 00 00 00 20 40 64 00 00 00\\n"
    scenario = f'project = "bench.toml"\n[scenario]\nname = "pasted"\nsteps = "{steps}"\n'
    (tmp_path / "check.toml").write_text(scenario, encoding="utf-8")
    assert main(["scenario", str(tmp_path / "check.toml")]) == 0, capsys.readouterr().out


def test_the_descriptions_on_the_page_of_siemens_are_right(tmp_path: Path) -> None:
    from trcvtui.project.file import load_project

    connects = next(
        block for block in re.findall(r"```toml\n(.*?)```", SIEMENS, re.DOTALL) if "[[connect]]" in block
    )
    (tmp_path / "s.toml").write_text('dialect = "s7-1500"\n' + connects, encoding="utf-8")
    by_field, by_bytes = load_project(tmp_path / "s.toml").connects
    assert by_field.description is not None and by_bytes.description is not None
    assert by_field.description.data[4:] == by_bytes.description.data[4:]
