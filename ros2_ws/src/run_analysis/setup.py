from setuptools import find_packages, setup

setup(
    name="run_analysis",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/run_analysis"]),
        ("share/run_analysis", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The Alula developers",
    maintainer_email="alula@alula-robotics.org",
    description="What recorded runs tell: conformance to the model, expectations, comparison, campaigns",
    license="Apache-2.0",
)
