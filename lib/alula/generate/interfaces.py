"""The package `<skillset>_interfaces`: one action a skill (paper, section 4.2), built for ROS 1 and ROS 2 from the same files."""

from __future__ import annotations

from collections.abc import Iterable

from alula.generate.text import MAINTAINER, comment, fill, header, lines, packages
from alula.language.robot import Robot
from alula.model.model import Parameter, Skill, Skillset
from alula.model.ros_types import camel

PACKAGE_XML = """\
<?xml version="1.0"?>
<!-- $header. -->
<package format="3">
  <name>$package</name>
  <version>0.1.0</version>
  <description>The actions of the skillset $skillset.</description>
  $maintainer
  <license>Apache-2.0</license>

  <buildtool_depend condition="$$ROS_VERSION == 1">catkin</buildtool_depend>
  <build_depend condition="$$ROS_VERSION == 1">message_generation</build_depend>
  <exec_depend condition="$$ROS_VERSION == 1">message_runtime</exec_depend>
  <depend condition="$$ROS_VERSION == 1">actionlib_msgs</depend>

  <buildtool_depend condition="$$ROS_VERSION == 2">ament_cmake</buildtool_depend>
  <buildtool_depend condition="$$ROS_VERSION == 2">rosidl_default_generators</buildtool_depend>
  <depend condition="$$ROS_VERSION == 2">action_msgs</depend>
  <exec_depend condition="$$ROS_VERSION == 2">rosidl_default_runtime</exec_depend>
  <member_of_group condition="$$ROS_VERSION == 2">rosidl_interface_packages</member_of_group>

$depends

  <export>
    <build_type condition="$$ROS_VERSION == 2">ament_cmake</build_type>
  </export>
</package>
"""

CMAKE = """\
# $header.
# One package, two worlds: actionlib's actions and ROS 2's from the same files.
cmake_minimum_required(VERSION 3.16)
project($package)

if("$$ENV{ROS_VERSION}" STREQUAL "1")
  find_package(catkin REQUIRED COMPONENTS message_generation actionlib_msgs)
  # A type that has no ROS 1 form costs this skillset its managers there, and no other skillset anything.
  set(missing)
  foreach(dependency$ros1_names)
    find_package($${dependency} QUIET)
    if(NOT $${dependency}_FOUND)
      list(APPEND missing $${dependency})
    endif()
  endforeach()
  if(missing)
    message(WARNING "$${PROJECT_NAME} is not built for ROS 1: there is no ROS 1 package $${missing}")
    catkin_package()
    return()
  endif()
  add_action_files(DIRECTORY action FILES
$ros1_actions
  )
  # Managers and clients are Python; the headers of other languages would take most of the time. Alula's set-up, which leaves genpy out,
  # makes all of its modules in one process.
  set(languages)
  if(genpy IN_LIST CATKIN_MESSAGE_GENERATORS)
    set(languages genpy)
  endif()
  generate_messages(LANGS $${languages} DEPENDENCIES actionlib_msgs$ros1_names)
  catkin_package(CATKIN_DEPENDS message_runtime actionlib_msgs$ros1_names)
else()
  find_package(ament_cmake REQUIRED)
  find_package(rosidl_default_generators REQUIRED)
$find_packages
  rosidl_generate_interfaces($${PROJECT_NAME}
$actions
$dependencies
  )
  ament_export_dependencies(rosidl_default_runtime)
  ament_package()
endif()
"""

ACTION = """\
# $header.
# Skill $skill of the skillset $skillset: its inputs.
$inputs
---
# The terminal state: NOT_VALIDATED NOT_READY RESOURCE_INVARIANT_VIOLATED INTERRUPTED TERMINATED FAILED.
string outcome
# When TERMINATED, the result: $results.
string result
string message
$outputs
---
# 0 to 1$period.
float64 progress
# RUNNING PAUSED INTERRUPTING
string state
$outputs
"""


def interface_package(robot: Robot, skillset: Skillset) -> dict[str, str]:
    """Return the files of the interface package; none for a skillset without skills, as a package of no interfaces can't be built."""
    if not skillset.skills:
        return {}
    package = f"{skillset.name}_interfaces"
    parameters = [parameter for skill in skillset.skills for parameter in (*skill.inputs, *skill.outputs)]
    needed = [name for name in packages(robot.ros_type(p.type) for p in parameters) if name != "action_msgs"]
    skills = [skill.name for skill in skillset.skills]
    common = {"header": header(robot, skillset), "package": package}
    files = {
        f"{package}/package.xml": fill(
            PACKAGE_XML,
            **common,
            skillset=skillset.name,
            maintainer=MAINTAINER,
            depends=lines((f"<depend>{name}</depend>" for name in needed), 2),
        ),
        f"{package}/CMakeLists.txt": fill(
            CMAKE,
            **common,
            ros1_names="".join(f" {name}" for name in needed),
            ros1_actions=lines((f"{camel(name)}.action" for name in skills), 4),
            find_packages=lines((f"find_package({name} REQUIRED)" for name in needed), 2),
            actions=lines((f'"action/{camel(name)}.action"' for name in skills), 4),
            dependencies=f"    DEPENDENCIES {' '.join(needed)}" if needed else "",
        ),
    }
    files = {path: _without_empty_lines_in_a_row(text) for path, text in files.items()}
    for skill in skillset.skills:
        files[f"{package}/action/{camel(skill.name)}.action"] = action(robot, skillset, skill)
    return files


def action(robot: Robot, skillset: Skillset, skill: Skill) -> str:
    """Return a skill's action: goal = inputs, result = how it ended and outputs, feedback = progress and outputs."""
    text = fill(
        ACTION,
        header=header(robot, skillset),
        skillset=skillset.name,
        skill=skill.name,
        inputs=_fields(robot, skill.inputs),
        outputs=_fields(robot, skill.outputs),
        results=" ".join(result.name for result in skill.results),
        period=f", every {skill.progress.period_s:g} s" if skill.progress else "",
    )
    return lines(line for line in text.splitlines() if line) + "\n"


def _fields(robot: Robot, parameters: Iterable[Parameter]) -> str:
    return lines(f"{robot.ros_type(p.type).interface} {p.name}{comment(p.comment)}" for p in parameters)


def _without_empty_lines_in_a_row(text: str) -> str:
    while "\n\n\n" in text:
        text = text.replace("\n\n\n", "\n\n")
    return text
