"""The page for Prometheus: the present values of an agent, with a bounded number of label sets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from ipaddress import ip_address
from itertools import islice
from typing import Any, Final, NamedTuple

from trcvtui.errors import mistake
from trcvtui.fleet.seen_fleet import UP_STATES
from trcvtui.net.results import parse_end

MOST_ROWS: Final = 2000  # of one metric: lines or instances of one agent


class Metric(NamedTuple):
    """One metric. `value` reads the metric from an agent, a line or an instance, depending on `labels`."""

    name: str
    kind: str  # gauge or counter
    about: str
    labels: tuple[str, ...]
    value: Callable[[Any], float]


_AGENT: Final = ()
_LINE: Final = ("line",)
_INSTANCE: Final = ("line", "name")  # `instance` is a label of Prometheus itself
_UP_TEXT: Final = "1: the CONNECT is connected, the UDP_CONFIG ready, the port there"
METRICS: Final = (
    Metric(
        "trcvtui_broker_up", "gauge", "1: the broker has taken the agent", _AGENT, lambda a: a.is_broker_up
    ),
    Metric("trcvtui_queued", "gauge", "messages that wait for the broker", _AGENT, lambda a: a.queued),
    Metric("trcvtui_dropped", "counter", "messages dropped for lack of room", _AGENT, lambda a: a.dropped),
    Metric("trcvtui_restarts", "counter", "restarts of the engine", _AGENT, lambda a: a.restarts),
    Metric("trcvtui_engine_up", "gauge", "1: the engine scans", _AGENT, lambda a: a.is_running),
    Metric("trcvtui_scan_age_seconds", "gauge", "age of the last scan", _AGENT, lambda a: a.scan_age_s),
    Metric("trcvtui_line_up", "gauge", _UP_TEXT, _LINE, lambda line: line.state in UP_STATES),
    Metric("trcvtui_received_bytes", "counter", "bytes", _LINE, lambda line: line.received),
    Metric("trcvtui_sent_bytes", "counter", "bytes", _LINE, lambda line: line.sent),
    Metric("trcvtui_status", "gauge", "STATUS", _INSTANCE, lambda i: int(i.status.status, 16)),
    Metric("trcvtui_error", "gauge", "1: ERROR", _INSTANCE, lambda i: i.status.error),
    Metric("trcvtui_jobs_done", "counter", "DONEs", _INSTANCE, lambda i: i.jobs_done),
    Metric("trcvtui_errors", "counter", "calls that show ERROR", _INSTANCE, lambda i: i.errors),
    Metric("trcvtui_here_bytes", "gauge", "bytes of the job", _INSTANCE, lambda i: i.status.here),
)


def _label_rows(agent: Any, labels: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], object]]:
    if labels == _AGENT:
        yield (), agent
    elif labels == _LINE:
        yield from (((line.name,), line) for line in [*agent.seen.lines.values()])
    else:
        yield from (((i.line, i.name), i) for i in [*agent.seen.instances.values()] if i.status)


def parse_page_address(text: str) -> tuple[str, int]:
    """Return address and port of `--metrics`; raise UserError for a wrong text."""
    found = parse_end(text)
    if found is None or found[1] is None:
        raise mistake("--metrics", f"'{text}'", "ADDR:PORT such as 127.0.0.1:9464")
    return str(ip_address(found[0])), found[1]


class MetricsCollector:
    def __init__(self, agent: Any) -> None:
        self._agent = agent

    def collect(self) -> Iterator[Any]:
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

        kinds = {"gauge": GaugeMetricFamily, "counter": CounterMetricFamily}
        for metric in METRICS:
            family = kinds[metric.kind](metric.name, metric.about, labels=metric.labels)
            for labels, of in islice(_label_rows(self._agent, metric.labels), MOST_ROWS):  # bounds the page
                family.add_metric(labels, metric.value(of))
            yield family


def start_page_server(address: str, port: int, agent: Any) -> Any:
    """Return the server of the page; raise OSError if the port is not free."""
    from prometheus_client import start_http_server
    from prometheus_client.core import CollectorRegistry

    registry = CollectorRegistry()
    registry.register(MetricsCollector(agent))
    server, _ = start_http_server(port, address, registry)
    return server
