"""What pip, colcon and catkin read of the library; everything that only pip needs is in pyproject.toml."""

import sys

from setuptools import find_packages, setup

if sys.version_info < (3, 11):  # noqa: UP036 - as `requires-python` colcon could not read it: it wants literals only
    sys.exit("error: alula needs Python 3.11 or newer")

setup(
    name="alula",
    version="0.2.0",
    packages=find_packages(include=["alula", "alula.*"]),
    package_dir={"": "."},  # so that an editable installation is a path, not an import hook
    package_data={
        "alula": ["py.typed"],
        "alula.console": ["page/*"],
        "alula.language": ["examples.yaml"],
        "alula.prove": ["examples.yaml"],
        "alula.scaffold": ["robot/**/*.in"],
    },
    data_files=[("share/ament_index/resource_index/packages", ["resource/alula"]), ("share/alula", ["package.xml"])],
)
