#!/usr/bin/env bash
# Says what of Alula is installed, what is missing, and how to mend it. Changes nothing. Exit code 0: all is well, 1: something is missing.
ALULA_ROOT="$(cd "$(dirname "$(readlink -f "$0")")/.." && pwd)"
. "$ALULA_ROOT/setup/places.sh"
missing=0

good() { printf '  ok       %-34s %s\n' "$1" "${2:-}"; }
bad()  { printf '  missing  %-34s %s\n           to mend it: %s\n' "$1" "${2:-}" "$3"; missing=1; }

echo "machine"
if command -v apt-get >/dev/null && command -v dpkg-query >/dev/null; then
  . /etc/os-release; good "Debian-like system" "${PRETTY_NAME:-}"
else
  bad "Debian-like system" "there is no apt-get" "use Debian 12 or 13, or a container (docs/how-to/containers.md)"
fi
[ "$(uname -m)" = x86_64 ] && good "processor" "x86_64, $(nproc) cores" || bad "processor" "$(uname -m)" "the ROS 2 wheels exist for x86_64 only"
good "free disk" "$(df -Pm "$ALULA_ROOT" | awk 'NR==2{print $4}') MB; an installation takes about 3000 MB"

echo "Debian packages"
list=$ALULA_STATE/debian.txt   # what was to be installed; before the first set-up all of it
[ -f "$list" ] || list=$ALULA_ROOT/setup/apt.txt
needed=$(awk -v sealed="$([ -f "$ALULA_STATE/sealed" ] && echo 1)" '/^# Only to build/ && sealed {exit} !/^#/ {print $1}' "$list")
wanted=$(wc -w <<<"$needed")
absent=$(comm -23 <(sort <<<"$needed") \
  <(dpkg-query -W -f '${db:Status-Status} ${binary:Package}\n' 2>/dev/null | awk '$1=="installed"{sub(/:.*/,"",$2);print $2}' | sort))
[ -z "$absent" ] && good "packages of setup/apt.txt" "all $wanted" || bad "packages of setup/apt.txt" "$(echo $absent)" "./alula setup (as root or with sudo)"

look() { # WORLD TITLE PYTHON: the last line that the code prints is shown
  local said
  if [ -x "$ALULA_STATE/venv$1/bin/python" ] && said=$("$ALULA_ROOT/setup/in_ros$1" python -c "$3" 2>&1); then
    good "$2" "$said"
  else
    bad "$2" "$(printf '%s' "${said:-not installed}" | tail -n 1 | cut -c1-100)" "./alula setup; if that does not help, remove $ALULA_STATE and set up again"
  fi
}

echo "ROS 1 world"
look 1 "rospy" "import rospy, roslaunch, rosbag; print(rospy.__file__)"
look 1 "Open3D, OpenCV, MAVLink" "import open3d, cv2, pymavlink; print(open3d.__version__, cv2.__version__, pymavlink.__version__)"
look 1 "message packages (catkin_make)" "import skillset_interfaces.srv; print('skillset_interfaces')"

echo "ROS 2 world"
look 2 "rclpy" "import os, rclpy; print(os.environ['ROS_DISTRO'], rclpy.__file__)"
look 2 "message packages (colcon)" "import skillset_interfaces.srv, tf2_msgs.msg; print('skillset_interfaces, tf2_msgs')"
look 2 "proofs and language server" "import z3, dd.cudd, pygls; print('z3', z3.get_version_string())"
look 2 "bridge" "import ros_bridge, rosbags; print('ros_bridge')"

if [ -n "$ALULA_ROBOT" ]; then
  echo "the robot $ALULA_ROBOT"
  # Each skillset's generated packages, as they are imported in a run.
  IMPORTED="import importlib, os, pathlib
for path in sorted(pathlib.Path(os.environ['ALULA_ROBOT_STATE'], 'generated').glob('*_%s')): importlib.import_module(path.name); print(path.name, end=' ')"
  look 1 "generated messages (catkin_make)" "${IMPORTED/\%s/interfaces}"
  look 2 "generated skillsets (colcon)" "${IMPORTED/\%s/managers}"
fi

[ $missing = 0 ] && echo "all is well" || echo "something is missing, see above"
exit $missing
