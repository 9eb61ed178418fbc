from setuptools import find_packages, setup

setup(
    name="skill_runtime",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={"skill_runtime": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/skill_runtime"]),
        ("share/skill_runtime", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="alula@alula-robotics.org",
    description="Executes a skillset: the engine without ROS, managers and client over rclpy.",
    license="Apache-2.0",
)
