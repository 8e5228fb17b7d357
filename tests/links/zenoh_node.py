"""Program for test_zenoh_link.py: one node in its own process. Reads commands and prints the pages it stores, as lines
of JSON.
"""

from __future__ import annotations

import json
import sys
import threading
from typing import Any

from snr_sim import Config, Node, Task, TaskType, Tls, ZenohNet, tasks
from snr_sim.testing.parts import PartFactory


def main() -> None:
    role, net, link = sys.argv[1], json.loads(sys.argv[2]), json.loads(sys.argv[3])
    tls = Tls(**net.pop("tls")) if "tls" in net else None

    def tell(task: Task, task_id: Any) -> None:
        page = task.val_list[0]
        print(json.dumps([page.key, page.data, page.origin]), flush=True)

    factories = [ZenohNet(tls=tls, **net).link(**link), PartFactory({TaskType.store_page: tell}, "tell")]
    node = Node(role, Config(factories={role: factories}))

    def obey() -> None:
        for line in sys.stdin:
            key, values = json.loads(line)
            for value in values:
                node.store_data(key, value)
        node.enter(tasks.terminate("nothing more is wanted"), "test")

    threading.Thread(target=obey, daemon=True).start()
    node.loop()


if __name__ == "__main__":
    main()
