#!/usr/bin/env bash
# Builds a robot's own part on top of Alula's installation, in $ALULA_ROBOT_STATE: what its models generate, its ROS packages, and an
# environment in each world that has its own Python packages and sees Alula's. Needs setup.sh before it; idempotent like that one.
set -u
ALULA_ROOT="$(cd "$(dirname "$(readlink -f "$0")")/.." && pwd)"
. "$ALULA_ROOT/setup/places.sh"
exec 1>&2
state=$ALULA_ROBOT_STATE what="the robot $ALULA_ROBOT"
steps="robot underlays apt venv1 venv2 generated ros1 ros2"
# usage: robot.sh [--quiet] [--only STEP[,STEP]...]
quiet=0 only=${steps// /,}
while [ $# -gt 0 ]; do
  case "$1" in
    --quiet) quiet=1 ;;
    --only) only="robot,underlays,$2"; shift ;;
  esac
  shift
done
. "$ALULA_ROOT/setup/steps.sh"
said() { [ ! -f "$state/robot.env" ] || . "$state/robot.env"; }   # what robot.yaml says, for the steps below
robot_name="" robot_skillsets="" robot_packages1="" robot_packages2="" robot_python1="" robot_python2="" robot_underlays1=() robot_underlays2=() robot_debian1="" robot_debian2="" robot_fleet=()
said

title_robot="what robot.yaml says"
key_robot() { digest "$ALULA_ROBOT/robot.yaml" "$ALULA_ROOT/lib/alula/common/robots.py" "$ALULA_ROOT/setup/describe_robot.py"; }
make_robot() {
  clean "$ALULA_STATE/venv2/bin/python3" "$ALULA_ROOT/setup/describe_robot.py" >"$state/robot.env.new" && mv "$state/robot.env.new" "$state/robot.env"
}

title_underlays="what lies below Alula"
key_underlays() { # of which packages there are: a whole ROS has too many files to read them each time
  echo "${robot_underlays1[*]} / ${robot_underlays2[*]}"
  digest "$ALULA_ROOT"/setup/{underlays.sh,given_ros.py}
  [ -z "${robot_underlays1[*]}${robot_underlays2[*]}" ] ||
    find -L "${robot_underlays1[@]}" "${robot_underlays2[@]}" -maxdepth 4 \( -name 'setup.*' -o -name package.xml \) -printf '%p %T@\n' | LC_ALL=C sort | digest -
}
make_underlays() { sourced 1 "${robot_underlays1[@]}" && sourced 2 "${robot_underlays2[@]}"; }
sourced() { # WORLD FOLDER...: all of them, and the first ones that hold a whole ROS between them, on which Alula can stand
  local world=$1 count found; shift
  "$ALULA_ROOT/setup/underlays.sh" "$@" >"$state/underlays$world.env" && : >"$state/whole$world.env" || return 1
  for ((count = 1; count <= $#; count++)); do
    "$ALULA_ROOT/setup/underlays.sh" "${@:1:count}" >"$state/first.env" && found=$(beside "$state/first.env" "$world") || return 1
    [ -z "$found" ] || { printf '%s\n' "$found" >>"$state/first.env" && mv "$state/first.env" "$state/whole$world.env"; return; }
  done
  rm -f "$state/first.env"
}

missing_packages() { [ -z "$robot_debian1$robot_debian2" ] || missing_of $robot_debian1 $robot_debian2; }
title_apt="Debian packages of the robot"
key_apt() { echo "$robot_debian1 $robot_debian2"; [ ! -f "$state/stamps/apt" ] || missing_packages; }
make_apt() { install_packages "$(missing_packages)"; }

# An environment of its own sees Alula's by a path file; without pip in it, which it has from there.
make_environment() { # WORLD PINS OPTIONS...
  local world=$1 pins=$2; shift 2
  [ -n "$pins" ] || rm -rf "$state/venv$world"
  make_venv "$state/venv$world" --without-pip "$@" &&
    ( . "$state/underlays$world.env" && clean "$ALULA_STATE/venv$world/bin/python3" "$ALULA_ROOT/setup/link_packages.py" robot "$world" ) &&
    { [ -z "$pins" ] || clean "$state/venv$world/bin/python3" "$ALULA_ROOT/setup/sync_packages.py" "$pins"; }
}
key_environment() { # WORLD PINS
  echo "$(cat "$ALULA_STATE/stamps/venv$1" "$state/underlays$1.env" 2>/dev/null)-$(digest "${2:-/dev/null}" "$ALULA_ROOT"/setup/link_packages.py)-$state"
}
title_venv1="the robot's Python packages of the ROS 1 world"
key_venv1() { key_environment 1 "$robot_python1"; }
make_venv1() { make_environment 1 "$robot_python1" --system-site-packages; }
title_venv2="the robot's Python packages of the ROS 2 world"
key_venv2() { key_environment 2 "$robot_python2"; }
make_venv2() { make_environment 2 "$robot_python2"; }

title_generated="skillsets: interfaces, managers, bridge configuration"
key_generated() { # of the models and of what generates from them
  echo "$robot_name $robot_skillsets"
  find "$robot_skillsets" "${robot_fleet[@]}" "$ALULA_ROOT"/lib/alula/{model,language,generate} -type f \( -name '*.py' -o -name '*.skill' -o -name '*.rl' -o -name '*.yaml' \) \
    -not -path '*/test/*' -print0 2>/dev/null | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -c1-16
}
make_generated() {
  if [ ${#robot_fleet[@]} -gt 0 ]; then   # a fleet's missions call the skills of its robots, and need no more
    clean "$ALULA_STATE/venv2/bin/python3" -m alula.cli.generate "${robot_fleet[@]}" --interfaces --out "$state/generated" --prune
    return
  fi
  [ -d "$robot_skillsets" ] || { mkdir -p "$state/generated"; return; }   # a robot without models so far
  # In place: what is as it was keeps its time stamps, so that a changed skillset rebuilds no other.
  clean "$ALULA_STATE/venv2/bin/python3" -m alula.cli.generate "$robot_skillsets" --name "$robot_name" --out "$state/generated" --prune
}

make_workspace() { # WORLD
  ( . "$ALULA_ROOT/setup/env.sh" "$1" && python3 "$ALULA_ROOT/setup/build_ros$1.py" robot && python3 "$ALULA_ROOT/setup/link_packages.py" robot "$1" )
}
key_workspace() { # WORLD PLACES
  local world=$1 places; IFS=: read -ra places <<<"$2"
  echo "$(tree_digest "${places[@]}" "$state/generated")-$(cat "$state/stamps/venv$world" "$ALULA_STATE/stamps/ros$world" 2>/dev/null)"
}
title_ros1="the robot's ROS 1 workspace (catkin_make)"
key_ros1() { key_workspace 1 "$robot_packages1"; }
make_ros1() { make_workspace 1; }
title_ros2="the robot's ROS 2 workspace (colcon build)"
key_ros2() { key_workspace 2 "$robot_packages2"; }
make_ros2() { make_workspace 2; }

if [ -f "$ALULA_STATE/sealed" ]; then
  [ -f "$state/robot.env" ] || fail "$(cat "$ALULA_STATE/sealed")" "build $ALULA_ROBOT on top of the image alula:test"
  exit 0
fi
begin
run robot
said
run underlays
check_rights "$(missing_packages)"
run apt
together venv1 venv2 generated
together ros1 ros2
end
