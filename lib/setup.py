"""What pip, colcon and catkin read of the library; everything that only pip needs is in pyproject.toml."""

from setuptools import find_packages, setup

setup(
    name="alula",
    version="0.2.0",
    packages=find_packages(include=["alula", "alula.*"]),
    package_dir={"": "."},  # so that an editable installation is a path, not an import hook
    package_data={"alula": ["py.typed"], "alula.console": ["page/*"], "alula.scaffold": ["robot/**/*.in"]},
    data_files=[("share/ament_index/resource_index/packages", ["resource/alula"]), ("share/alula", ["package.xml"])],
)
