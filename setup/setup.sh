#!/usr/bin/env bash
# Installs and builds Alula, from a bare Debian 12 or 13 to what every robot stands on: both worlds' Python, and the general ROS packages.
# Idempotent: a step whose inputs have not changed is skipped. Everything it makes lies in $ALULA_STATE (default: .alula in the checkout);
# each step's log is log/STEP.log there. A robot's own part is robot.sh's.
set -u
ALULA_ROOT="$(cd "$(dirname "$(readlink -f "$0")")/.." && pwd)"
. "$ALULA_ROOT/setup/places.sh"
robot=$ALULA_ROBOT robots_state=$ALULA_ROBOT_STATE
ALULA_ROBOT="" ALULA_ROBOT_STATE=""   # nothing here is a robot's, but that its underlays may hold a ROS to stand on
exec 1>&2     # standard output belongs to the results of the command that needs the set-up
state=$ALULA_STATE what=Alula
steps="apt venv2 given debian venv1 wheels ros1 ros2"
quiet=0 runtime=() only=${steps// /,}
steps+=" browser"   # of the tests of pages alone: only where it is asked for
# usage: setup.sh [--quiet] [--runtime] [--only STEP[,STEP]...]
while [ $# -gt 0 ]; do
  case "$1" in
    --quiet) quiet=1 ;;                # says nothing where nothing is to be done
    --runtime) runtime=(--runtime) ;;  # without what only builds and tests need
    --only) only=$2; shift ;;
  esac
  shift
done
. "$ALULA_ROOT/setup/steps.sh"
disk_needed_mb=5000

check_machine() {
  command -v apt-get >/dev/null && command -v dpkg-query >/dev/null ||
    fail "this is not a Debian-like system: there is no apt-get" "use Debian 12 or 13, or a container (docs/how-to/containers.md)"
  [ "$(uname -m)" = x86_64 ] || fail "the ROS 2 wheels exist for x86_64 only, this is $(uname -m)" "use an x86_64 machine"
  local free_mb; free_mb=$(df -Pm "$ALULA_STATE" | awk 'NR==2{print $4}')
  [ -x "$ALULA_STATE/venv2/bin/python" ] || [ "$free_mb" -ge $disk_needed_mb ] ||
    fail "$free_mb MB free at $ALULA_STATE, $disk_needed_mb MB are needed" "free some space, or set ALULA_STATE to a folder on a larger disk"
}

missing_packages() { # LIST COLUMNS: those of its lines that have so many; ROS packages have two
  missing_of $(awk -v runtime=${#runtime[@]} -v columns="$2" '/^# Only to build/ && runtime {exit} !/^#/ && NF == columns {print $1}' "$1")
}
missing_tools() { missing_packages "$ALULA_ROOT/setup/apt.txt" 1; }
missing_ros() { missing_packages "$state/debian.txt" 2; }

title_apt="Debian packages (Python, build tools)"
key_apt() { echo "$(digest "$ALULA_ROOT/setup/apt.txt")${runtime[*]}"; [ ! -f "$state/stamps/apt" ] || missing_tools; }
make_apt() { install_packages "$(missing_tools)"; }

# Each world of an installation stands on one ROS: on that of the robot which it was made for (its variables are in given1.env and
# given2.env), else on one of its own, and then it stays so: it may be shared by robots that bring theirs and others that bring none.
title_given="what there is of ROS"
of_robot() { # WORLD
  [ -f "$state/given$1.env" ] && [ ! -s "$state/given$1.env" ] || cat "$robots_state/whole$1.env" 2>/dev/null
}
key_given() { of_robot 1; of_robot 2; digest "$ALULA_ROOT"/setup/{apt.txt,jazzy.txt,given_ros.py}; }
make_given() {
  local world
  for world in 1 2; do
    of_robot $world >"$state/given.new"
    if [ -s "$state/given$world.env" ] && [ -s "$state/given.new" ] && [ "$(places "$state/given$world.env")" != "$(places "$state/given.new")" ]; then
      echo "error: this installation stands on the ROS $world of another robot's underlays: set ALULA_STATE to another folder for $robot"
      return 1
    fi
    mv "$state/given.new" "$state/given$world.env"
  done
  beside "$state/given1.env" 1 "$ALULA_ROOT/setup/apt.txt" >"$state/debian.txt" &&
    beside "$state/given2.env" 2 "$ALULA_ROOT/setup/jazzy.txt" >"$state/wheels.txt"
}
places() { grep ALULA_UNDERLAYS= "$1"; }
read_underlays() { # of the robot, where it names some
  ! grep -qs underlays "$robot/robot.yaml" || ALULA_ROBOT=$robot "$ALULA_ROOT/setup/robot.sh" --quiet --only underlays || exit 2
}

title_debian="Debian packages (ROS 1)"
key_debian() { echo "$(digest "$state/debian.txt")${runtime[*]}"; [ ! -f "$state/stamps/debian" ] || missing_ros; }
make_debian() { install_packages "$(missing_ros)"; }

make_environment() { # WORLD OPTIONS...: with the pinned packages of the world
  local world=$1; shift
  /usr/bin/python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    { echo "alula: $(/usr/bin/python3 --version) is too old: Alula needs Python 3.11, as Debian 12 and 13 and Ubuntu 24.04 have it"; return 1; }
  make_venv "$state/venv$world" "$@" &&
    clean "$state/venv$world/bin/python3" "$ALULA_ROOT/setup/sync_packages.py" "$ALULA_ROOT/setup/ros$world.txt" "${runtime[@]}" --beside "$ALULA_ROOT/setup/jazzy.txt" &&
    link_packages "$world"
}
link_packages() { # WORLD
  ( [ ! -f "$state/given$1.env" ] || . "$state/given$1.env"; clean "$state/venv$1/bin/python3" "$ALULA_ROOT/setup/link_packages.py" alula "$1" )
}
key_environment() { echo "$(digest "$ALULA_ROOT/setup/ros$1.txt" "$ALULA_ROOT"/setup/{sync_packages,link_packages}.py)-$state${runtime[*]}"; }
title_venv1="Python packages of the ROS 1 world"
key_venv1() { key_environment 1; }
make_venv1() { make_environment 1 --system-site-packages; }
title_venv2="Python packages of the ROS 2 world"
key_venv2() { key_environment 2; }
make_venv2() { make_environment 2; }
title_wheels="ROS 2 (Jazzy wheels)"
key_wheels() { echo "$(digest "$state/wheels.txt" "$state/given2.env" "$ALULA_ROOT/setup/repair_wheels.py")-$(cat "$state/stamps/venv2" 2>/dev/null)"; }
make_wheels() {
  clean "$state/venv2/bin/python3" "$ALULA_ROOT/setup/sync_packages.py" "$state/wheels.txt" "${runtime[@]}" --beside "$ALULA_ROOT/setup/ros2.txt" &&
    link_packages 2 && clean "$state/venv2/bin/python3" "$ALULA_ROOT/setup/repair_wheels.py"
}

make_workspace() { # WORLD
  ( . "$ALULA_ROOT/setup/env.sh" "$1" && python3 "$ALULA_ROOT/setup/build_ros$1.py" alula && python3 "$ALULA_ROOT/setup/link_packages.py" alula "$1" )
}
key_workspace() { # WORLD FOLDER...
  local world=$1; shift
  echo "$(tree_digest "$@")-$(cat "$state/stamps/venv$world" "$state/given$world.env" "$state/stamps/wheels" 2>/dev/null)-$(digest "$ALULA_ROOT"/setup/{"workspace.py","build_ros$world.py",link_packages.py,interfaces.cmake})"
}
title_ros1="ROS 1 workspace (catkin_make)"
key_ros1() { key_workspace 1 "$ALULA_ROOT"/ros1_ws/src/{skillset_interfaces,skillset_ros1,resource_reporter,alula_base,node_core}; }
make_ros1() { make_workspace 1; }
title_ros2="ROS 2 workspace (colcon build)"
key_ros2() { key_workspace 2 "$ALULA_ROOT/bridge" "$ALULA_ROOT"/ros2_ws/src/{skillset_ros2,skill_panel}; }
make_ros2() { make_workspace 2; }

missing_browser() { missing_of chromium chromium-driver; }
title_browser="Debian's browser (tests of pages)"
key_browser() { echo chromium; [ ! -f "$state/stamps/browser" ] || missing_browser; }
make_browser() { install_packages "$(missing_browser)"; }

if [ -f "$state/sealed" ]; then   # an image that flies, without what builds
  [ $quiet = 1 ] || cat "$state/sealed"
  exit 0
fi
[ ! -f "$state/stamps/venv2" ] || read_underlays
begin
check_machine
check_rights "$(missing_tools)"
run apt
run venv2
read_underlays
run given
[ ! -f "$state/debian.txt" ] || check_rights "$(missing_ros)"
run debian
together venv1 wheels
together ros1 ros2
! asked browser || check_rights "$(missing_browser)"
run browser
end
