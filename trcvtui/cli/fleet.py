"""Commands of many lines: an agent, the screen of all agents."""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path

from trcvtui.cli.options import (
    Args,
    CommandParser,
    add_kernel,
    add_no_secrets,
    add_project,
    add_theme,
    load_bench_project,
    run_sink,
)
from trcvtui.cli.streams import has_terminal
from trcvtui.errors import mistake, require

BROKER_HELP = "MQTT broker; user and password: $TRCVTUI_MQTT_USER, $TRCVTUI_MQTT_PASSWORD"


def _add_certificates(parser: CommandParser) -> None:
    parser.add_argument("--mqtt-ca", metavar="FILE", help="CA of the broker's certificate (PEM)")
    parser.add_argument("--mqtt-cert", metavar="FILE", help="certificate of this client (PEM)")
    parser.add_argument("--mqtt-key", metavar="FILE", help="key of --mqtt-cert (PEM)")


def set_up_agent(parser: CommandParser) -> None:
    parser.description = "Runs a bench as a service, and publishes it to MQTT, Prometheus or both."
    add_project(parser)
    add_kernel(parser)
    parser.add_argument("--site", default="default", help='site in the MQTT topics; default: "default"')
    parser.add_argument("--name", help="name in the MQTT topics; default: HOST-PROJECT")
    parser.add_argument("--mqtt", metavar="mqtts://HOST", help=BROKER_HELP)
    _add_certificates(parser)
    parser.add_argument("--metrics", metavar="ADDR:PORT", help="address of the metrics page for Prometheus")
    parser.add_argument("--record", metavar="DIR", type=Path, help="record each run in this folder")
    parser.add_argument("--ring", metavar="SIZE", default="256MiB", help="size of all files; default: 256MiB")
    add_no_secrets(parser)
    about = 'capture program for [[watch]], such as "dumpcap -q -i eth0 -w -"'
    parser.add_argument("--packets", metavar="COMMAND", help=about)
    about = "publish the evidence of findings, which may contain payload"
    parser.add_argument("--with-payload", action="store_true", help=about)


def _agent(args: Args) -> int:
    import shlex

    from trcvtui.fleet.agent import AgentSettings, default_name, run_agent
    from trcvtui.fleet.broker import parse_broker
    from trcvtui.fleet.metrics import parse_page_address
    from trcvtui.recording.files import RecordTarget
    from trcvtui.scenario.record import read_limits

    path = args.project
    if args.mqtt is None and args.metrics is None:
        raise mistake("trcvtui agent", "no output", "--mqtt mqtts://HOST or --metrics ADDR:PORT, or both")
    for option, value in (("--site", args.site), ("--name", args.name)):
        if value == "":
            raise mistake(option, "an empty name", "a name: each topic has it as a level")
    page = None if args.metrics is None else parse_page_address(args.metrics)
    if page is not None:
        require("prometheus_client", "metrics", "--metrics", "no prometheus-client")
    broker = None
    if args.mqtt is not None:
        broker = parse_broker(args.mqtt, args.mqtt_ca, args.mqtt_cert, args.mqtt_key)
        require("paho.mqtt.client", "fleet", "--mqtt", "no paho-mqtt")
    project, record = load_bench_project(path), None
    if args.record is not None:
        from trcvtui.files import make_folder

        for folder in (args.record, args.record / path.stem):
            make_folder(folder, "--record")
        limits = read_limits(args.ring, None, None, None, None)
        record = RecordTarget(args.record / path.stem, False, not args.no_secrets, limits, run_sink())
    name = args.name or default_name(path)
    try:
        packets = tuple(shlex.split(args.packets or ""))
    except ValueError as wrong:
        raise mistake("--packets", str(wrong), "a program and its arguments") from None
    settings = AgentSettings(
        path, args.kernel, args.site, name, broker, page, record, args.with_payload, packets
    )
    return run_agent(settings, project)


def set_up_fleet(parser: CommandParser) -> None:
    parser.description = "Shows the lines of all agents on one screen."
    parser.add_argument("url", metavar="mqtts://HOST", help=BROKER_HELP)
    parser.add_argument(
        "--site", metavar="PATTERN", default="*", help='only these sites, such as "plant*"; default: all'
    )
    _add_certificates(parser)
    add_theme(parser)


def _fleet(args: Args) -> int:
    from trcvtui.clock import utc_ns
    from trcvtui.fleet.broker import NO_TLS_TEXT, parse_broker

    broker = parse_broker(args.url, args.mqtt_ca, args.mqtt_cert, args.mqtt_key, where="trcvtui fleet")
    require("paho.mqtt.client", "fleet", "--mqtt", "no paho-mqtt")
    if not has_terminal():
        raise mistake("trcvtui fleet", "no terminal", "a terminal; for scripts: docs/fleet-formats.md")
    if not broker.has_tls:
        sys.stderr.write(f"{NO_TLS_TEXT}\n")
    gc.disable()  # until the list is shown: imported modules stay, to collect them only costs time
    os.environ.setdefault("TEXTUAL_FPS", "200")
    from trcvtui.tui.fleet.app import run_fleet

    return run_fleet(broker, args.site, f"fleet-{utc_ns():x}-{os.getpid()}", args.theme)


COMMANDS = {
    "agent": ("a bench as a service", "line.toml --mqtt mqtts://HOST", set_up_agent, _agent),
    "fleet": ("all agents on one screen", "mqtts://HOST", set_up_fleet, _fleet),
}
