"""The page for Prometheus: what an agent knows now, with a bounded number of label sets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from ipaddress import ip_address
from typing import Any, Final, NamedTuple, Protocol

from trcvtui.errors import mistake
from trcvtui.fleet.lines import SeenBench
from trcvtui.net.results import end_in_words

MOST_ROWS: Final = 2000  # of one metric: lines or instances of one agent


class PageSource(Protocol):
    """What the page tells of the one that runs the lines."""

    seen: SeenBench
    restarts: int

    @property
    def is_running(self) -> bool:
        """Return whether the engine is there."""
        ...

    @property
    def is_up(self) -> bool:
        """Return whether the broker has taken us."""
        ...

    @property
    def queued(self) -> int:
        """Return how many messages wait."""
        ...

    @property
    def dropped(self) -> int:
        """Return how many messages had no room."""
        ...


class Metric(NamedTuple):
    """One metric: what it tells, its labels, its rows out of an agent."""

    name: str
    kind: str  # gauge or counter
    about: str
    labels: tuple[str, ...]
    rows: Callable[[PageSource], Iterable[tuple[tuple[str, ...], float]]]


def _of_lines(
    value: Callable[[Any], float],
) -> Callable[[PageSource], Iterator[tuple[tuple[str, ...], float]]]:
    return lambda agent: (((line.name,), value(line)) for line in [*_bench(agent).lines.values()])


def _of_instances(
    value: Callable[[Any], float],
) -> Callable[[PageSource], Iterator[tuple[tuple[str, ...], float]]]:
    return lambda agent: (
        ((each.line, each.name), value(each)) for each in [*_bench(agent).instances.values()] if each.status
    )


def _of_agent(
    value: Callable[[PageSource], float],
) -> Callable[[PageSource], list[tuple[tuple[str, ...], float]]]:
    return lambda agent: [((), value(agent))]


def _bench(agent: PageSource) -> SeenBench:
    return agent.seen


_INSTANCE: Final = ("line", "name")  # `instance` is a label of Prometheus itself
METRICS: Final = (
    Metric(
        "trcvtui_broker_up", "gauge", "1: the broker has taken the agent", (), _of_agent(lambda a: a.is_up)
    ),
    Metric("trcvtui_queued", "gauge", "messages that wait for the broker", (), _of_agent(lambda a: a.queued)),
    Metric("trcvtui_dropped", "counter", "messages without room", (), _of_agent(lambda a: a.dropped)),
    Metric(
        "trcvtui_restarts", "counter", "engines that were started anew", (), _of_agent(lambda a: a.restarts)
    ),
    Metric("trcvtui_engine_up", "gauge", "1: the engine scans", (), _of_agent(lambda a: a.is_running)),
    Metric(
        "trcvtui_line_up",
        "gauge",
        "1: the CONNECT is connected, the UDP_CONFIG ready, the port there",
        ("line",),
        _of_lines(lambda line: line.state in ("connected", "created", "up")),
    ),
    Metric("trcvtui_received_bytes", "counter", "bytes", ("line",), _of_lines(lambda line: line.received)),
    Metric("trcvtui_sent_bytes", "counter", "bytes", ("line",), _of_lines(lambda line: line.sent)),
    Metric("trcvtui_status", "gauge", "STATUS", _INSTANCE, _of_instances(lambda i: int(i.status.status, 16))),
    Metric("trcvtui_error", "gauge", "1: ERROR", _INSTANCE, _of_instances(lambda i: i.status.error)),
    Metric("trcvtui_jobs_done", "counter", "DONEs", _INSTANCE, _of_instances(lambda i: i.jobs_done)),
    Metric("trcvtui_errors", "counter", "ERROR edges", _INSTANCE, _of_instances(lambda i: i.errors)),
    Metric(
        "trcvtui_here_bytes", "gauge", "bytes of the job", _INSTANCE, _of_instances(lambda i: i.status.here)
    ),
)


def place_of_page(text: str) -> tuple[str, int]:
    """Return address and port of `--metrics`; raise UserError."""
    found = end_in_words(text)
    if found is None or found[1] is None:
        raise mistake("--metrics", f"'{text}'", "ADDR:PORT such as 127.0.0.1:9464")
    return str(ip_address(found[0])), found[1]


class MetricsPage:
    """What prometheus-client asks when somebody reads the page."""

    def __init__(self, agent: PageSource) -> None:
        self._agent = agent

    def collect(self) -> Iterator[Any]:
        """Yield each metric with its rows."""
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

        kinds = {"gauge": GaugeMetricFamily, "counter": CounterMetricFamily}
        for metric in METRICS:
            family = kinds[metric.kind](metric.name, metric.about, labels=metric.labels)
            for labels, value in list(metric.rows(self._agent))[:MOST_ROWS]:
                family.add_metric(list(labels), value)
            yield family


def serve_page(address: str, port: int, agent: PageSource) -> Any:
    """Serve the page; return what ends it."""
    try:
        from prometheus_client import start_http_server
        from prometheus_client.core import CollectorRegistry
    except ImportError:
        raise mistake("--metrics", "no prometheus-client", "pip install 'trcvtui[metrics]'") from None
    registry = CollectorRegistry()
    registry.register(MetricsPage(agent))
    try:
        server, _ = start_http_server(port, address, registry)
    except OSError as failed:
        raise mistake("--metrics", f"'{failed.strerror}' at {address}:{port}", "a free place") from None
    return server
