"""The package of the node, for colcon."""

from setuptools import setup

NAME = "kerfpath_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/rviz", ["rviz/trajectory.rviz"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The kerfpath authors",
    maintainer_email="kerfpath@example.org",
    description="A node that plans with kerfpath: the action Plan, and trajectories for RViz.",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"planner = {NAME}.planner:main"]},
)
