#!/usr/bin/env bash
# Installs and builds Alula, from a bare Debian 12 or 13 to a tree that flies. Idempotent: a step whose inputs have not changed is skipped.
# Everything it makes lies in $ALULA_STATE (default: .alula in the checkout); each step's log is log/STEP.log there.
set -u
ALULA_ROOT="$(cd "$(dirname "$(readlink -f "$0")")/.." && pwd)"
ALULA_STATE="${ALULA_STATE:-$ALULA_ROOT/.alula}"
export ALULA_ROOT ALULA_STATE
logs="$ALULA_STATE/log"
disk_needed_mb=5000
started=$SECONDS
exec 1>&2     # standard output belongs to the results of the command that needs the set-up
# usage: setup.sh [--quiet] [--runtime] [--only STEP[,STEP]...]
quiet=0 runtime=() only=apt,venv1,venv2,generated,ros1,ros2
while [ $# -gt 0 ]; do
  case "$1" in
    --quiet) quiet=1 ;;                # says nothing where nothing is to be done
    --runtime) runtime=(--runtime) ;;  # without what only builds and tests need
    --only) only=$2; shift ;;
  esac
  shift
done

fail() { printf '\nalula setup: %s\n' "$1" >&2; [ -n "${2:-}" ] && printf '  to mend it: %s\n' "$2" >&2; exit 2; }

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }

# step NAME KEY FUNCTION TITLE: runs FUNCTION if KEY differs from the one it last succeeded with.
step() {
  local name=$1 key=$2 function=$3 title=$4 stamp="$ALULA_STATE/stamps/$1" log="$logs/$1.log" begun=$SECONDS
  [ "$(cat "$stamp" 2>/dev/null)" = "$key" ] && return 0
  printf '  %-58s begins\n' "$title"
  rm -f "$stamp"
  if "$function" >"$log" 2>&1; then
    printf '  %-58s %3d s  done\n' "$title" $((SECONDS - begun))
    printf '%s' "$key" >"$stamp"
  else
    local reason; reason=$(tac "$log" | grep -E '^(E: |ERROR|error:|[A-Za-z]+Error: |CMake Error|.*: error: |.*: error ALU[0-9]+: |alula: )' | head -n 1)
    fail "'$title' failed: ${reason:-see the log}" "the last lines of $log tell more; './alula setup' goes on where it stopped"
  fi
}

# run STEP: unless --only leaves it out.
run() { [[ ",$only," != *",$1,"* ]] || "step_$1"; }

# together STEP...: runs steps that do not need one another side by side; the set-up ends when all have, if one has failed.
together() {
  local name worker workers=() failed=0
  set -m   # a process group each, which Ctrl-C ends
  for name in "$@"; do run "$name" & workers+=($!); done
  set +m
  trap 'kill -- "${workers[@]/#/-}" 2>/dev/null; exit 130' INT TERM
  for worker in "${workers[@]}"; do wait "$worker" || failed=1; done
  [ $failed = 0 ] || exit 2
}

digest() { cat "$@" 2>/dev/null | sha256sum | cut -c1-16; }
tree_digest() { # of all files below the given folders that decide what is built
  find -L "$@" -type f \( -name '*.msg' -o -name '*.srv' -o -name '*.action' -o -name CMakeLists.txt -o -name package.xml -o -name 'setup.*' \
    -o -name '*.cpp' -o -name '*.hpp' -o -path '*/scripts/*' \) -not -path '*/__pycache__/*' -print0 2>/dev/null | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -c1-16
}

model_digest() { # of the models and of what generates from them
  ( cd "$ALULA_ROOT" && find skillsets lib/alula/model lib/alula/language -type f \( -name '*.py' -o -name '*.skill' -o -name '*.rl' -o -name '*.yaml' \) \
      -not -path '*/.*' -not -path '*/test/*' -print0 | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -c1-16 )
}

check_machine() {
  command -v apt-get >/dev/null && command -v dpkg-query >/dev/null ||
    fail "this is not a Debian-like system: there is no apt-get" "use Debian 12 or 13, or a container (docs/containers.md)"
  [ "$(uname -m)" = x86_64 ] || fail "the ROS 2 wheels exist for x86_64 only, this is $(uname -m)" "use an x86_64 machine"
  local free_mb; free_mb=$(df -Pm "$ALULA_STATE" | awk 'NR==2{print $4}')
  [ -x "$ALULA_STATE/venv2/bin/python" ] || [ "$free_mb" -ge $disk_needed_mb ] ||
    fail "$free_mb MB free at $ALULA_STATE, $disk_needed_mb MB are needed" "free some space, or set ALULA_STATE to a folder on a larger disk"
}

missing_packages() { # names of setup/apt.txt that dpkg does not have installed
  local wanted; wanted=$(awk -v runtime=${#runtime[@]} '/^# Only to build/ && runtime {exit} !/^#/' "$ALULA_ROOT/setup/apt.txt")
  comm -23 <(printf '%s\n' $wanted | sort) \
    <(dpkg-query -W -f '${db:Status-Status} ${binary:Package}\n' 2>/dev/null | awk '$1=="installed"{sub(/:.*/,"",$2);print $2}' | sort)
}

install_packages() {
  local missing; missing=$(missing_packages)
  [ -z "$missing" ] && return 0
  as_root apt-get update -q || return 1
  for name in $missing; do
    apt-cache show "$name" >/dev/null 2>&1 || { echo "alula: this system has no package '$name'; Debian 12 and 13 have it, and Ubuntu in 'universe'"; return 1; }
  done
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $missing
}

# The environment of a world; one that is there already, of the same Python and in the same place, gets the differences only.
make_venv() { # WORLD OPTIONS...
  local world=$1 venv="$ALULA_STATE/venv$1"; shift
  # A virtual environment of the user's own must not leak into these two.
  local clean=(env -u VIRTUAL_ENV -u PYTHONPATH -u PYTHONHOME)
  local version='import sys; print(sys.version)'
  /usr/bin/python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    { echo "alula: $(/usr/bin/python3 --version) is too old: Alula needs Python 3.11, as Debian 12 and 13 and Ubuntu 24.04 have it"; return 1; }
  [ "$(head -n 1 "$venv/bin/pip" 2>/dev/null)" = "#!$venv/bin/python3" ] &&
    [ "$("${clean[@]}" "$venv/bin/python3" -c "$version" 2>/dev/null)" = "$(/usr/bin/python3 -c "$version")" ] ||
    { rm -rf "$venv" && "${clean[@]}" /usr/bin/python3 -m venv "$@" "$venv" || return 1; }
  "${clean[@]}" "$venv/bin/python3" "$ALULA_ROOT/setup/sync_packages.py" "$ALULA_ROOT/setup/ros$world.txt" "${runtime[@]}" &&
    "${clean[@]}" "$venv/bin/python3" -m pip --no-input --disable-pip-version-check install --quiet --no-deps --no-build-isolation --editable "$ALULA_ROOT/lib"
}
make_venv1() { make_venv 1 --system-site-packages; }
make_venv2() { make_venv 2 && "$ALULA_STATE/venv2/bin/python" "$ALULA_ROOT/setup/repair_wheels.py"; }

# What a robot's models generate. A robot whose models have errors is left out, and named at each command until it is mended.
generate() {
  ( . "$ALULA_ROOT/setup/env.sh" 2
    rm -f "$ALULA_STATE/broken_robots"
    # In place: what is as it was keeps its time stamps, so that a changed skillset rebuilds no other.
    python -m alula.language.generate "$ALULA_ROOT"/skillsets/*/ --out "$ALULA_STATE/generated" --prune && exit
    local robot good=() try; try=$(mktemp -d) || exit 1
    for robot in "$ALULA_ROOT"/skillsets/*/; do
      if python -m alula.language.generate "$robot" --out "$try"; then good+=("$robot"); else basename "$robot" >>"$ALULA_STATE/broken_robots"; fi
    done
    rm -rf "$try"
    [ ${#good[@]} -gt 0 ] && python -m alula.language.generate "${good[@]}" --out "$ALULA_STATE/generated" --prune )
}

tell_broken_robots() {
  local robot
  while read -r robot; do
    echo "alula: the robot '$robot' is left out, its models have errors; './alula check skillsets/$robot/*.skill' shows them"
  done 2>/dev/null <"$ALULA_STATE/broken_robots"
}

make_ros1() { ( . "$ALULA_ROOT/setup/env.sh" 1 && python3 "$ALULA_ROOT/setup/build_ros1.py" && python3 "$ALULA_ROOT/setup/link_packages.py" 1 ); }

make_ros2() {
  ( . "$ALULA_ROOT/setup/env.sh" 2
    unset PYTHONPATH LD_LIBRARY_PATH
    export AMENT_PREFIX_PATH="$ALULA_STATE/venv2" CMAKE_PREFIX_PATH="$ALULA_STATE/venv2"
    python "$ALULA_ROOT/setup/build_ros2.py" && python "$ALULA_ROOT/setup/link_packages.py" 2 )
}

if [ -f "$ALULA_STATE/sealed" ]; then   # an image that flies, without what builds
  [ $quiet = 1 ] || cat "$ALULA_STATE/sealed"
  exit 0
fi
mkdir -p "$ALULA_STATE/stamps" "$logs" "$ALULA_STATE/ros2" 2>/dev/null || fail "can't write to $ALULA_STATE" "check its owner, or set ALULA_STATE to a folder of yours"
exec 9>"$ALULA_STATE/lock"
command -v flock >/dev/null && { flock -n 9 || { echo "another setup of this checkout is running, waiting for it"; flock 9; }; }
check_machine
[ $quiet = 1 ] || echo "Alula setup (logs: $logs)"
if [ -n "$(missing_packages)" ]; then
  [ "$(id -u)" = 0 ] || command -v sudo >/dev/null ||
    fail "Debian packages are missing ($(missing_packages | head -n 3 | paste -sd' ')...), and this is neither root nor is there sudo" "run './alula setup' once as root"
  rm -f "$ALULA_STATE/stamps/apt"
fi
step_apt() { step apt "$(digest "$ALULA_ROOT/setup/apt.txt")${runtime[*]}" install_packages "Debian packages (ROS 1, build tools)"; }
step_venv1() { step venv1 "$(digest "$ALULA_ROOT"/setup/{ros1.txt,sync_packages.py} "$ALULA_ROOT"/lib/{setup.py,pyproject.toml})-$ALULA_STATE${runtime[*]}" make_venv1 "Python packages of the ROS 1 world"; }
step_venv2() {
  step venv2 "$(digest "$ALULA_ROOT"/setup/{ros2.txt,repair_wheels.py,sync_packages.py} "$ALULA_ROOT"/lib/{setup.py,pyproject.toml})-$ALULA_STATE${runtime[*]}" make_venv2 "Python packages of the ROS 2 world (Jazzy wheels)"
}
step_generated() { step generated "$(model_digest)" generate "skillsets: interfaces, managers, bridge configuration"; }
step_ros1() {
  step ros1 "$(tree_digest "$ALULA_ROOT/ros1_ws/src" "$ALULA_STATE"/generated/*_interfaces)-$(cat "$ALULA_STATE/stamps/venv1")-$(digest "$ALULA_ROOT"/setup/{workspace,build_ros1,link_packages}.py)" make_ros1 "ROS 1 workspace (catkin_make)"
}
step_ros2() {
  local scripts; scripts=$(digest "$ALULA_ROOT"/setup/{workspace.py,build_ros2.py,link_packages.py,interfaces.cmake})
  step ros2 "$(tree_digest "$ALULA_ROOT/ros2_ws/src" "$ALULA_ROOT/bridge")-$(tree_digest "$ALULA_STATE/generated")-$(cat "$ALULA_STATE/stamps/venv2")-$scripts" make_ros2 "ROS 2 workspace (colcon build)"
}
run apt
together venv1 venv2
run generated
[ ! -f "$ALULA_STATE/broken_robots" ] || tell_broken_robots
together ros1 ros2
[ $quiet = 1 ] || echo "Alula is ready ($((SECONDS - started)) s)"
