from setuptools import find_packages, setup

setup(
    name="skill_model",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={"skill_model": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/skill_model"]),
        ("share/skill_model", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="alula@alula-robotics.org",
    description="The skill model, its JSON form and its execution semantics.",
    license="Apache-2.0",
)
