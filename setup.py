"""Packaging for both installs: pip (``pip install -e '.[wheels]'``) and ROS (``colcon build``)."""

import re
from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "actuated_characters"
ROOTS = (
    "msgs_config",
    "sim_node",
    "controller_node",
    "character_motion",
    "actuated_characters",
    "lecture",
)
SHARED = {
    "launch": "*.launch.py",
    "config": "*.*",
    "examples": "*.*",
    "examples/trials": "*",
    "examples/without_rclpy": "*",
}
PACKAGE_XML = ElementTree.parse("package.xml")  # has the maintainer and the address
MAINTAINER = PACKAGE_XML.find("maintainer")
PICTURE, LINK = r"!\[[^]]*\]\([^)]*\)\n", r"\[([^]]*)\]\((?!https?:)[^)]*\)"


def read_readme():
    """The README without what an index of packages cannot show: pictures and pages of the clone."""
    text = Path("README.md").read_text(encoding="utf-8")
    return re.sub(LINK, r"\1", re.sub(PICTURE, "", text))


setup(
    name=PACKAGE,
    version="0.3.0",  # catkin_prepare_release writes it here and in package.xml
    description="Physically simulated characters, actuated by torques over ROS 2 topics.",
    long_description=read_readme(),
    long_description_content_type="text/markdown",
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get("email"),
    url=PACKAGE_XML.findtext("url[@type='repository']"),
    license="Apache-2.0",
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Education",
        "Intended Audience :: Science/Research",
        "License :: OSI Approved :: Apache Software License",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3.11",
        "Programming Language :: Python :: 3.12",
        "Programming Language :: Python :: 3.13",
        "Topic :: Scientific/Engineering :: Physics",
    ],
    keywords="ROS 2, physics simulation, character animation, motion tracking, determinism",
    python_requires=">=3.11,<3.14",
    packages=find_packages(include=[pattern for root in ROOTS for pattern in (root, f"{root}.*")]),
    package_data={
        "": ["py.typed"],
        "msgs_config": ["runtime/*.xml", "character/data/*", "terrain/data/*"],
        "controller_node": [
            "references/data/*.yaml",
            "references/timeline/data/*.yaml",
            "behaviours/state_machine/data/*.yaml",
            "planner/policy/shipped/*.npz",
        ],
        "actuated_characters": [
            "scenes/*.yaml",
            "scenes/data/*",
            "trial/data/*.yaml",
            "viewer/editor/time_edits.*s",
            "viewer/recorded/time_bar.*s",
        ],
        "lecture": ["labs/stubs/*.py", "labs/bodies/*"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        *(
            (f"share/{PACKAGE}/{folder}", glob(f"{folder}/{pattern}"))
            for folder, pattern in SHARED.items()
        ),
    ],
    zip_safe=False,
    # What every install takes from pip. ROS itself is not among it: in a full ROS install rclpy and
    # the messages are there already (under other names), pip would put a second, different copy
    # beside them, and a requirement that is not met stops a program that imports pkg_resources.
    install_requires=[
        "lz4>=4.0,<5",  # which rosbags needs as well
        "manifold3d>=3.1,<4",  # closed surfaces of skins (4 MB, Apache-2.0)
        "matplotlib>=3.6,<4",
        "mcap>=1.6,<2",  # writes bags, and reads files that were never closed
        # What each tick computes is compiled by numba (210 MB with llvmlite, BSD-2; 0.3 s more CPU
        # at the start). Any version will do: its code makes the same sums in the same order.
        "llvmlite>=0.44",
        "mujoco-core==4.0.1",  # exactly: another engine may have other last bits
        "numba>=0.61,<0.70",
        "numpy>=1.26,<3",
        "pillow>=9.1",  # textures of meshes; matplotlib needs it as well
        # Exactly, likewise, where it has a wheel; elsewhere the engine is MuJoCo, and the robots
        # that come with it are to be had by `python -m msgs_config.fetch_robots`.
        "pybullet==3.2.7; python_version < '3.12'",
        "pycollada>=0.9,<0.10",  # meshes of every eighth robot (1.7 MB, BSD-3, pure Python)
        "PyYAML>=6.0,<7",
        "rich>=13.7,<16",
        "rosbags>=0.11.9,<0.12",
    ],
    extras_require={
        # ROS 2 Jazzy for a machine without ROS; the Makefile installs this extra.
        "wheels": [
            "ros-jazzy-common-interfaces>=5.3.6,<5.4",
            "ros-jazzy-rclpy>=7.1.6,<7.2",
            "ros-rclpy[fastrtps]>=7.1.6,<7.2",
        ],
        # The engine Bullet where pip must compile it (eight minutes of a processor).
        "bullet": ["pybullet==3.2.7"],
        # `export` of a policy as .onnx (36 MB with what it needs, Apache-2.0), and the behaviour
        # `onnx`, which plays others' (onnxruntime: a download of 28 MB, MIT).
        "onnx": ["onnx>=1.17,<2", "onnxruntime>=1.20,<2"],
        # `gymnasium.make("actuated_characters/Track-v0")` (4 MB with what it needs, MIT).
        "gymnasium": ["gymnasium>=1.0,<2"],
        # `make docs`: the pages as a site (60 MB with what they need, BSD-2 and MIT).
        "docs": ["furo>=2024.8", "myst-parser>=4,<6", "sphinx>=8,<9"],
        # `sweep`: on all processors, or on a cluster of Dask (35 MB with what it needs, BSD-3).
        # cryptography keeps its ports from others (17 MB, Apache-2.0 or BSD-3); pyarrow writes the
        # table as Parquet, too (170 MB, Apache-2.0), and may be missing.
        "sweep": ["cryptography>=42", "dask>=2025.1", "distributed>=2025.1", "pyarrow>=17"],
        # Completion of the command line in bash and zsh (43 kB, Apache-2.0, pure Python).
        "completion": ["argcomplete>=3.5,<4"],
        # `view` and `run --view`: characters in a browser (50 MB with what it needs, MIT; the web
        # client is in the wheel, and works offline). The checks of requests and messages, and how
        # poses are sent, go by what 1.1 is like inside.
        "view": ["msgspec>=0.19", "viser>=1.1,<1.2", "websockets>=16,<17"],
        # Films of recordings. Its wheel (36 MB, BSD-3) carries FFmpeg with libx264, which is GPL.
        "video": ["av>=14,<19"],
        # Pinocchio, which `make robots` compares masses and forces with (BSD-2, 380 MB with what it
        # needs); the URDF files themselves go to build/robots, without what their packages need.
        "robots": ["pin>=3.7,<5"],
        # Meshes of .glb and .ply files to collide with (4.8 MB, MIT, pure Python).
        "meshes": ["trimesh>=4.5,<6"],
        # Characters in .xacro files (76 kB, BSD-3, pure Python); a ROS install has it.
        "xacro": ["xacro>=2.0,<3"],
        # `colcon test` chooses pytest because this extra, of this name, lists it.
        # The linters are held to one minor version: a new one may have new rules.
        "test": [
            "argcomplete>=3.5,<4",
            "av>=14,<19",
            "cryptography>=42",
            "dask>=2025.1",
            "distributed>=2025.1",
            "furo>=2024.8",
            "gymnasium>=1.0,<2",
            "hypothesis>=6.98,<7",
            "import-linter>=2.9,<3",
            "mcap-ros2-support>=0.5.5,<0.7",
            "mypy>=2.4,<2.5",
            "myst-parser>=4,<6",
            "onnx>=1.17,<2",
            "onnxruntime>=1.20,<2",
            "pyarrow>=17",
            "pytest>=7.4,<10",
            "pytest-xdist>=3.5,<4",
            "ruff>=0.17.5,<0.18",
            # An environment of Python 3.12 has none; 70.1 is the first to make wheels by itself, 80
            # is colcon's limit.
            "setuptools>=70.1,<80",
            "sphinx>=8,<9",
            "trimesh>=4.5,<6",  # reads meshes for tests to compare with
            "types-PyYAML>=6.0.12",
            "urdfdom-py>=1.2.1.post1,<2",
            "viser>=1.1,<1.2",
            "xacro>=2.0,<3",
        ],
    },
    entry_points={
        "console_scripts": [
            "sim_node = sim_node.main:main",
            "controller_node = controller_node.main:main",
            "recorder = actuated_characters.recorder.main:main",
            "viewer = actuated_characters.viewer.main:main",
            "composed = actuated_characters.composed.main:main",
            "ros2_control_bridge = actuated_characters.ros2_control.main:main",
            "actuated_characters = actuated_characters.cli:main",
        ],
    },
)
