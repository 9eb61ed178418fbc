"""Read the mapping rules of ``ros1_bridge``, as packages have them in ``mapping_rules.yaml``: a list of packages, messages and services.

A rule names packages, or a message or service in each of them, and perhaps which field is which (``fields_1_to_2``, of a service
``request_fields_1_to_2`` and ``response_fields_1_to_2``). As there, a rule that names fields names all that cross.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ros_bridge.errors import ConfigError
from ros_bridge.mapping import TypeRule, TypeRules

if TYPE_CHECKING:
    from alula.common.located_yaml import Located

PACKAGES = ("ros1_package_name", "ros2_package_name")
MESSAGES = ("ros1_message_name", "ros2_message_name")
SERVICES = ("ros1_service_name", "ros2_service_name")
FIELDS, REQUEST_FIELDS, RESPONSE_FIELDS = "fields_1_to_2", "request_fields_1_to_2", "response_fields_1_to_2"
IGNORED = "enable_foreign_mappings"  # that a package may have rules for types of others: here any file may
KEYS = (*PACKAGES, *MESSAGES, *SERVICES, FIELDS, REQUEST_FIELDS, RESPONSE_FIELDS, IGNORED)


def read_mapping_rules(root: Located) -> TypeRules:
    """Return the rules of a document that is a list; raises ConfigError."""
    packages: dict[str, str] = {}
    rules: list[TypeRule] = []
    for item in root.elements():
        parts = item.record("a mapping rule", KEYS)
        ros1, ros2 = _pair(item, parts, PACKAGES)
        if any(key in parts for key in MESSAGES):
            one, two = _pair(item, parts, MESSAGES)
            rules.append(_rule(f"{ros1}/{one}", f"{ros2}/{two}", parts, FIELDS))
        elif any(key in parts for key in SERVICES):
            one, two = _pair(item, parts, SERVICES)
            names = f"{ros1}/{one}", f"{ros2}/{two}"
            rules.append(TypeRule(*names))
            for half, key in (("_Request", REQUEST_FIELDS), ("_Response", RESPONSE_FIELDS)):
                rules.append(_rule(names[0] + half, names[1] + half, parts, key))
        else:
            packages[ros1] = ros2
    return TypeRules(packages, rules)


def _pair(item: Located, parts: Mapping[str, Located], keys: tuple[str, str]) -> tuple[str, str]:
    for key in keys:
        if key not in parts:
            raise item.wrong(f"a mapping rule has no `{key}`")
    one, two = (parts[key].text(f"`{key}`") for key in keys)
    return one, two


def _rule(ros1: str, ros2: str, parts: Mapping[str, Located], key: str) -> TypeRule:
    if key not in parts:
        return TypeRule(ros1, ros2)
    fields = {name: value.text(f"`{key}`") for name, value in parts[key].entries(f"`{key}`").items()}
    if not fields or not all(fields.values()):
        raise ConfigError(f"{parts[key].place}: `{key}` has to name fields of both worlds (`ros1: ros2`)")
    return TypeRule(ros1, ros2, fields, complete=True)
