"""What stands around the PLC: the peer, the clock, the engine process, the scenario runner."""

from trcvtui.paths import configs_path as configs_path
from trcvtui.paths import demo_path as demo_path
