from setuptools import find_packages, setup

setup(
    name="mission_console",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={"mission_console": ["page/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/mission_console"]),
        ("share/mission_console", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="alula@alula-robotics.org",
    description="The operator's page: follow and command a run in a browser, live and as a report.",
    license="Apache-2.0",
)
