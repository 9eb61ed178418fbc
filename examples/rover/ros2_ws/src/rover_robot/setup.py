from setuptools import find_packages, setup

setup(
    name="rover_robot",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/rover_robot"]),
        ("share/rover_robot", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="You",
    maintainer_email="you@example.org",
    description="The hooks of the rover's skills, its nodes of missions, and its part of the report.",
    license="Apache-2.0",
)
