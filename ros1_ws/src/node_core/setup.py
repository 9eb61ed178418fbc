from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

packages = ["node_core", "node_core.ros", "node_core.replay"]
setup(**generate_distutils_setup(packages=packages, package_dir={"": "src"}))
