#!/usr/bin/env bash
# Installs and builds Alula, from a bare Debian 12 or 13 to what every robot stands on: both worlds' Python, and the general ROS packages.
# Idempotent: a step whose inputs have not changed is skipped. Everything it makes lies in $ALULA_STATE (default: .alula in the checkout);
# each step's log is log/STEP.log there. A robot's own part is robot.sh's.
set -u
ALULA_ROOT="$(cd "$(dirname "$(readlink -f "$0")")/.." && pwd)"
. "$ALULA_ROOT/setup/places.sh"
ALULA_ROBOT="" ALULA_ROBOT_STATE=""   # nothing here is a robot's
exec 1>&2     # standard output belongs to the results of the command that needs the set-up
state=$ALULA_STATE what=Alula
steps="apt venv1 venv2 ros1 ros2"
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
    fail "this is not a Debian-like system: there is no apt-get" "use Debian 12 or 13, or a container (docs/containers.md)"
  [ "$(uname -m)" = x86_64 ] || fail "the ROS 2 wheels exist for x86_64 only, this is $(uname -m)" "use an x86_64 machine"
  local free_mb; free_mb=$(df -Pm "$ALULA_STATE" | awk 'NR==2{print $4}')
  [ -x "$ALULA_STATE/venv2/bin/python" ] || [ "$free_mb" -ge $disk_needed_mb ] ||
    fail "$free_mb MB free at $ALULA_STATE, $disk_needed_mb MB are needed" "free some space, or set ALULA_STATE to a folder on a larger disk"
}

missing_packages() { # of setup/apt.txt
  missing_of $(awk -v runtime=${#runtime[@]} '/^# Only to build/ && runtime {exit} !/^#/' "$ALULA_ROOT/setup/apt.txt")
}

title_apt="Debian packages (ROS 1, build tools)"
key_apt() { echo "$(digest "$ALULA_ROOT/setup/apt.txt")${runtime[*]}"; [ ! -f "$state/stamps/apt" ] || missing_packages; }
make_apt() { install_packages "$(missing_packages)"; }

make_environment() { # WORLD OPTIONS...: with the pinned packages of the world
  local world=$1; shift
  /usr/bin/python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    { echo "alula: $(/usr/bin/python3 --version) is too old: Alula needs Python 3.11, as Debian 12 and 13 and Ubuntu 24.04 have it"; return 1; }
  make_venv "$state/venv$world" "$@" &&
    clean "$state/venv$world/bin/python3" "$ALULA_ROOT/setup/sync_packages.py" "$ALULA_ROOT/setup/ros$world.txt" "${runtime[@]}" &&
    clean "$state/venv$world/bin/python3" "$ALULA_ROOT/setup/link_packages.py" alula "$world"
}
key_environment() { echo "$(digest "$ALULA_ROOT/setup/ros$1.txt" "$ALULA_ROOT"/setup/{sync_packages,repair_wheels,link_packages}.py)-$state${runtime[*]}"; }
title_venv1="Python packages of the ROS 1 world"
key_venv1() { key_environment 1; }
make_venv1() { make_environment 1 --system-site-packages; }
title_venv2="Python packages of the ROS 2 world (Jazzy wheels)"
key_venv2() { key_environment 2; }
make_venv2() { make_environment 2 && "$state/venv2/bin/python" "$ALULA_ROOT/setup/repair_wheels.py"; }

make_workspace() { # WORLD
  ( . "$ALULA_ROOT/setup/env.sh" "$1" && python3 "$ALULA_ROOT/setup/build_ros$1.py" alula && python3 "$ALULA_ROOT/setup/link_packages.py" alula "$1" )
}
key_workspace() { # WORLD FOLDER...
  local world=$1; shift
  echo "$(tree_digest "$@")-$(cat "$state/stamps/venv$world")-$(digest "$ALULA_ROOT"/setup/{"workspace.py","build_ros$world.py",link_packages.py,interfaces.cmake})"
}
title_ros1="ROS 1 workspace (catkin_make)"
key_ros1() { key_workspace 1 "$ALULA_ROOT"/ros1_ws/src/{skillset_interfaces,skillset_ros1,resource_reporter}; }
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
begin
check_machine
check_rights "$(missing_packages)"
run apt
together venv1 venv2
together ros1 ros2
! asked browser || check_rights "$(missing_browser)"
run browser
end
