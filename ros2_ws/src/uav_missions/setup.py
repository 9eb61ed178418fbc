from setuptools import find_packages, setup

setup(
    name="uav_missions",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/uav_missions"]),
        ("share/uav_missions", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="developers@alula.example.org",
    description="Missions of the drone as Behaviour Trees whose leaves are skills",
    license="Apache-2.0",
)
