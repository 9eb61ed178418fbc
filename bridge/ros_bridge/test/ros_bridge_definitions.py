"""Definitions that tests write into files, as packages of either world have them."""

from collections.abc import Mapping
from pathlib import Path

from ros_bridge.conversion import Types
from ros_bridge.definitions import DefinitionFiles
from ros_bridge.mapping import TypeRules

SEPARATOR = "\n" + "=" * 80 + "\n"


def write(folder: Path, name: str, text: str, kind: str = "msg") -> None:
    """Write a definition ``package/Name`` below a folder of packages."""
    package, short = name.split("/")
    path = folder / package / kind / f"{short}.{kind}"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def write_all(folder: Path, texts: Mapping[str, str]) -> None:
    """Write definitions ``package/Name``, or ``package/srv/Name`` and ``package/action/Name``."""
    for name, text in texts.items():
        package, _, rest = name.partition("/")
        kind, _, short = rest.rpartition("/")
        write(folder, f"{package}/{short}", text, kind or "msg")


def types_of(folder: Path, ros1: Mapping[str, str], ros2: Mapping[str, str], rules: TypeRules | None = None) -> Types:
    """Return the types of two worlds that have these definitions in files."""
    write_all(folder / "ros1", ros1)
    write_all(folder / "ros2/share", ros2)
    return Types([folder / "ros2"], rules, DefinitionFiles([folder / "ros1"]))
