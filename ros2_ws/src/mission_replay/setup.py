from setuptools import find_packages, setup

setup(
    name="mission_replay",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/mission_replay"]),
        ("share/mission_replay", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="alula@alula-robotics.org",
    description="Makes the decisions of a recorded mission again",
    license="Apache-2.0",
)
