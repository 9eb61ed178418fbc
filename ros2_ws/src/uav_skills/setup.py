from setuptools import find_packages, setup

setup(
    name="uav_skills",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/uav_skills"]),
        ("share/uav_skills", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="developers@alula.example.org",
    description="What the drone's skills do",
    license="Apache-2.0",
)
