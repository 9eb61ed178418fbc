from setuptools import find_packages, setup

package_name = "skill_language"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
    ],
    package_data={"skill_language.scaffold": ["robot/**/*.in"]},
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="alula@alula-robotics.org",
    description="The skill language: two notations, checks, proofs, code generator and language server.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "skill_check = skill_language.check_cli:main",
            "skill_generate = skill_language.generate.__main__:main",
            "skill_server = skill_language.server:main",
        ],
    },
)
