"""What makes a folder of generated modules a package that colcon builds: its manifest, its setup files, its mark in the index."""

from __future__ import annotations

from collections.abc import Sequence

from alula.generate.text import MAINTAINER, fill, lines

PACKAGE_XML = """\
<?xml version="1.0"?>
<!-- $header. -->
<package format="3">
  <name>$package</name>
  <version>0.1.0</version>
  <description>$subject: $contents.</description>
  $maintainer
  <license>Apache-2.0</license>

$depends

  <export>
    <build_type>ament_python</build_type>
  </export>
</package>
"""

SETUP_PY = """\
# $header.
from setuptools import setup

setup(
    name="$package",
    version="0.1.0",
    packages=["$package"],
$package_data    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/$package"]),
        ("share/$package", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="developers@alula.example.org",
    description="$subject.",
    license="Apache-2.0",
$entry_points)
"""

SETUP_CFG = """\
# $header.
[develop]
script_dir=$$base/lib/$package
[install]
install_scripts=$$base/lib/$package
"""

PACKAGE_DATA = """\
    package_data={"$package": ["py.typed"]},
"""

ENTRY_POINTS = """\
    entry_points={"console_scripts": ["$script"]},
"""


def package_files(
    package: str, header: str, subject: str, contents: str, depends: Sequence[str], *, typed: bool = False, script: str = ""
) -> dict[str, str]:
    """Return the files around a package's modules.

    Args:
        package: its name.
        header: the sentence that every generated file begins with.
        subject: what the package is, as ``The robot uav for its users``.
        contents: what is in it.
        depends: packages that it needs.
        typed: whether users' type checkers may look into it (PEP 561); it holds ``py.typed`` then.
        script: a command that it installs, as ``mock = rover_managers.mock:main``.
    """
    common = {"header": header, "package": package, "subject": subject}
    files = {
        f"{package}/package.xml": fill(
            PACKAGE_XML,
            **common,
            contents=contents,
            maintainer=MAINTAINER,
            depends=lines((f"<depend>{name}</depend>" for name in depends), 2),
        ),
        f"{package}/setup.py": fill(
            SETUP_PY,
            **common,
            package_data=fill(PACKAGE_DATA, package=package) if typed else "",
            entry_points=fill(ENTRY_POINTS, script=script) if script else "",
        ),
        f"{package}/setup.cfg": fill(SETUP_CFG, **common),
        f"{package}/resource/{package}": "",
    }
    return files | ({f"{package}/{package}/py.typed": ""} if typed else {})
