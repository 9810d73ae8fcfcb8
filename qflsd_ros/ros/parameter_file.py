"""The YAML of ROS parameter files; imports no ROS."""
from __future__ import annotations

import yaml


class Loader(yaml.SafeLoader):
    """
    YAML as far as ROS takes it: without aliases (``*name``).

    rcl takes none, and a dozen lines of them can stand for gigabytes.
    """

    def compose_node(self, parent: yaml.Node | None, index: yaml.Node | int | None) -> yaml.Node:
        """Return the next node; yaml.YAMLError where it is an alias."""
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.YAMLError(f'line {event.start_mark.line + 1}: alias *{event.anchor}: '
                                 'a ROS parameter file has none, write out what it stands for')
        return super().compose_node(parent, index)
