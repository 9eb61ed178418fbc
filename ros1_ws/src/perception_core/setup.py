from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

packages = ["perception_core", "perception_core.ros", "perception_core.testing"]
setup(**generate_distutils_setup(packages=packages, package_dir={"": "src"}))
