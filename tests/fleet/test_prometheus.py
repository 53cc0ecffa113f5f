"""What an agent publishes for Prometheus, and the alerts and the dashboard that come along for it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from prometheus_client import generate_latest
from prometheus_client.core import CollectorRegistry

from tests.local_driver import LocalDriver
from trcvtui.engine.controller import fresh_bench
from trcvtui.fleet.lines import AgentBench
from trcvtui.fleet.metrics import METRICS, MetricsCollector
from trcvtui.paths import configs_path
from trcvtui.scenario.scenario import load_bench_project

SERVICE = configs_path() / "service"
RULES = SERVICE / "prometheus-rules.yml"
RULE_TESTS = Path(__file__).with_name("prometheus-rules.test.yml")
DASHBOARD: dict[str, Any] = json.loads((SERVICE / "grafana-dashboard.json").read_text(encoding="utf-8"))
QUERIES = [target["expr"] for panel in DASHBOARD["panels"] for target in panel["targets"]]
PROMTOOL = shutil.which("promtool")


class IdleAgent:
    """What the page asks of an agent."""

    is_running, is_broker_up, queued, dropped, restarts, scan_age_s = True, False, 3, 2, 1, 0.1

    def __init__(self) -> None:
        project = load_bench_project(configs_path() / "active.toml")
        driver = LocalDriver(fresh_bench(project, "sim"))
        driver.scan(100)
        self.seen = AgentBench("b", project.dialect.label)
        self.seen.handle_update(driver.shown(), 1.0)


@pytest.fixture(scope="module")
def published() -> set[str]:
    """Return the names of the rows on the page."""
    registry = CollectorRegistry()
    registry.register(MetricsCollector(IdleAgent()))
    page = generate_latest(registry).decode()
    return {re.split("[ {]", line)[0] for line in page.splitlines() if line[0] != "#"}


def metrics_in(text: str) -> set[str]:
    """Return the metrics that a text names; `trcvtui:..` is made by a rule."""
    return set(re.findall(r"\btrcvtui_\w+", re.sub(r"^ *#.*|trcvtui:\w+:\w+", "", text, flags=re.MULTILINE)))


def test_the_dashboard_shows_each_metric_that_an_agent_publishes_and_no_other(published: set[str]) -> None:
    assert metrics_in(" ".join(QUERIES)) == published and len(published) == len(METRICS)


def test_rules_and_their_tests_name_only_what_an_agent_publishes(published: set[str]) -> None:
    asked, given = (metrics_in(path.read_text(encoding="utf-8")) for path in (RULES, RULE_TESTS))
    assert len(asked) >= 9 and asked <= given <= published


def test_a_label_of_the_page_is_none_that_prometheus_takes_for_itself() -> None:
    assert {label for metric in METRICS for label in metric.labels} == {"line", "name"}


def test_panels_have_numbers_of_their_own_and_do_not_overlap() -> None:
    places = [panel["gridPos"] for panel in DASHBOARD["panels"]]
    assert len({panel["id"] for panel in DASHBOARD["panels"]}) == len(places)
    assert all(place["x"] + place["w"] <= 24 for place in places)
    for one, other in combinations(places, 2):
        apart = [
            one[at] + one[size] <= other[at] or other[at] + other[size] <= one[at]
            for at, size in ("xw", "yh")
        ]
        assert any(apart), (one, other)


def test_each_alert_waits_has_a_severity_and_says_what_to_do_and_a_test_lets_it_fire() -> None:
    _, *alerts = RULES.read_text(encoding="utf-8").split("- alert: ")
    tested = RULE_TESTS.read_text(encoding="utf-8")
    for alert in alerts:
        wanted = ("for: ", "severity: (critical|warning)", "summary: ", "description: ")
        assert all(re.search(f"^ +{each}", alert, re.MULTILINE) for each in wanted), alert
        assert f'{{alertname="{alert.split()[0]}"' in tested
    assert len(alerts) >= 10


@pytest.mark.slow
@pytest.mark.skipif(PROMTOOL is None, reason="no promtool: apt-get install prometheus")
def test_promtool_takes_the_rules_their_tests_and_the_queries_of_the_dashboard(tmp_path: Path) -> None:
    queries = tmp_path / "queries.yml"
    rules = [{"record": f"panel:{n}", "expr": query} for n, query in enumerate(QUERIES)]
    queries.write_text(json.dumps({"groups": [{"name": "dashboard", "rules": rules}]}))  # JSON is YAML
    for words in (["check", "rules", str(RULES), str(queries)], ["test", "rules", str(RULE_TESTS)]):
        done = subprocess.run([str(PROMTOOL), *words], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
