from setuptools import find_packages, setup

setup(
    name="alula_common",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/alula_common"]),
        ("share/alula_common", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="alula@alula-robotics.org",
    description="Plain Python that both ROS worlds and the tools share: files, processes, signals, ports and domains",
    license="Apache-2.0",
)
