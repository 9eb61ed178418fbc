from setuptools import find_packages, setup

setup(
    name="skill_panel",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={"skill_panel": ["panel.tcss"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/skill_panel"]),
        ("share/skill_panel", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="developers@alula.example.org",
    description="A panel in the terminal that shows running skillsets and controls them manually.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["panel = skill_panel.__main__:main"]},
)
