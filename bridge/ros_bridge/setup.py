from setuptools import setup

setup(
    name="ros_bridge",
    version="0.1.0",
    packages=["ros_bridge"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/ros_bridge"]),
        ("share/ros_bridge", ["package.xml"]),
    ],
    install_requires=["setuptools", "PyYAML", "rosbags"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="developers@alula.example.org",
    description="Topics and services between ROS 1 and ROS 2 in one process, as raw bytes, for any type, without a rebuild.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["ros_bridge = ros_bridge.cli:entry"]},
)
