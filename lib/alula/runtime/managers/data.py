"""The data manager (paper, section 4.2): keeps what the functional layer publishes, and passes it on latched."""

from __future__ import annotations

import functools
import importlib
import json
from collections.abc import Callable, Mapping

from alula.common.plain import to_plain
from alula.model.model import Skillset
from alula.model.ros_types import PRIMITIVES
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.middleware import Middleware, Reply, Topic, data_topic
from alula.runtime.staleness import StalenessWatch, is_stale, limit_ns
from alula.runtime.views import DataReading, Sample

DataBindings = Mapping[str, tuple[str, str]]
"""Where each data comes from: topic of the functional layer and ROS type, as the generated ``DATA_TOPICS``."""


class DataManager:
    """Tells ``update`` of each fresh value, and with None that it has become stale; the data's topics and service ``get_data``."""

    def __init__(
        self, middleware: Middleware, skillset: Skillset, bindings: DataBindings | None, update: Callable[[str, object | None], None]
    ) -> None:
        missing = [data.name for data in skillset.data if bindings is not None and data.name not in bindings]
        if missing:
            raise SkillRuntimeError(f"skillset {skillset.name}: no binding to a topic for data {', '.join(missing)}")
        self._middleware = middleware
        self._skillset = skillset.name
        self._update = update
        self._data = {data.name: data for data in skillset.data}
        self._received: dict[str, Sample] = {}
        self._staleness = StalenessWatch(middleware, lambda name: update(name, None))
        self._bindings = bound = bindings or {}
        self._publishers = {data.name: middleware.advertise(data_topic(data, bound.get(data.name, ("", ""))[1])) for data in skillset.data}

    def serve(self) -> None:
        """Take values, and questions for them."""
        for name, (source, type_name) in self._bindings.items():
            if name in self._data:
                topic = Topic(source, type_name=type_name, wrapped=self._data[name].type in PRIMITIVES, outside=True)
                self._middleware.subscribe(topic, functools.partial(self._take, name))
        self._middleware.serve("get_data", self._answer)

    def receive(self, name: str, value: object) -> None:
        """Take a value; raise KeyError when there is no such data."""
        if name not in self._data:
            raise KeyError(f"skillset {self._skillset} has no data {name}; it has {', '.join(self._data) or 'none'}")
        data, stamp_ns = self._data[name], self._middleware.now_ns()
        self._received[name] = Sample(value, stamp_ns)
        if (limit := limit_ns(data.period_s)) is not None:
            self._staleness.on_sample(name, stamp_ns, limit)
        self._publishers[name].publish(Sample(value, stamp_ns))
        self._update(name, value)

    def _take(self, name: str, sample: Sample) -> None:
        self.receive(name, sample.value)

    def read(self, name: str) -> DataReading:
        """Return what is known of a data now."""
        data, sample = self._data.get(name), self._received.get(name)
        if data is None or sample is None or sample.stamp_ns is None:
            return DataReading(data is not None, False, False, 0, "")
        stale = is_stale(self._middleware.now_ns() - sample.stamp_ns, data.period_s)
        return DataReading(True, True, stale, sample.stamp_ns, json.dumps(to_plain(sample.value)))

    def _answer(self, request: Mapping[str, object], reply: Reply) -> None:
        reply(self.read(str(request["name"])))


def generated_bindings(skillset: Skillset) -> DataBindings:
    """Return the generated ``<skillset>_managers.model.DATA_TOPICS``."""
    if not skillset.data:
        return {}
    bindings: DataBindings = importlib.import_module(f"{skillset.name}_managers.model").DATA_TOPICS
    return bindings
