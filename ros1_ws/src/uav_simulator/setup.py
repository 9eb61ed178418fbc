from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=[
            "uav_simulator",
            "uav_simulator.ardupilot",
            "uav_simulator.autopilot",
            "uav_simulator.following",
            "uav_simulator.sensors",
            "uav_simulator.vehicle",
            "uav_simulator.world",
        ],
        package_dir={"": "src"},
    )
)
