from setuptools import find_packages, setup

setup(
    name="skillset_ros2",
    version="0.3.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/skillset_ros2"]),
        ("share/skillset_ros2", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="developers@alula.example.org",
    description="Skillsets and missions over rclpy: the ROS 2 adapter of the library alula.",
    license="Apache-2.0",
)
