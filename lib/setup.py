"""What pip, colcon and catkin read of the library; everything that only pip needs is in pyproject.toml."""

import sys

from setuptools import find_packages, setup

distribution = setup(
    name="alula",
    version="0.3.0",
    python_requires=">=3.10",
    packages=find_packages(include=["alula", "alula.*"]),
    package_dir={"": "."},  # so that an editable installation is a path, not an import hook
    package_data={
        "alula": ["py.typed"],
        "alula.adopt": ["robot/*.in"],
        "alula.language": ["standard_messages.yaml"],
        "alula.report.page": ["program/*"],
        "alula.trees.nav2": ["nodes.xml"],
        "alula.generate.scaffold": ["robot/**/*.in"],
    },
    data_files=[("share/ament_index/resource_index/packages", ["resource/alula"]), ("share/alula", ["package.xml"])],
)

if "--dry-run" in sys.argv:  # colcon's look, which understands literals only: a range of versions is none
    distribution.python_requires = None
