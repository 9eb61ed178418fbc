# Sourced: the environment of one ROS world in this shell, with nothing of the other.  usage: . setup/env.sh 1|2
# ALULA_ROOT must be set. It is the robot's where its overlay has been built, else Alula's alone.
# The caller's ROS_MASTER_URI, ROS_DOMAIN_ID, ROS_LOG_DIR and display settings are kept.
_packages=${ROS_PACKAGE_PATH:-}
unset PYTHONHOME AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH PYTHONPATH LD_LIBRARY_PATH ROS_PACKAGE_PATH ROS_ROOT ROS_DISTRO VIRTUAL_ENV
unset ${!ALULA_UNDERLAY@} ROS_ETC_DIR
. "$ALULA_ROOT/setup/places.sh"
export PYTHONUNBUFFERED=1 PYTHONNOUSERSITE=1
# Container images often set it: then each of a run's many processes would compile all that it imports.
unset PYTHONDONTWRITEBYTECODE
# Numeric libraries: many small processes share few cores, a pool of threads in each only makes them wait for one another.
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}" OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}"
export MPLBACKEND=Agg
_path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin _robot=""
# The ROS that this installation stands on, where it has none of its own; what a robot names below itself begins with that.
[ ! -f "$ALULA_STATE/given$1.env" ] || . "$ALULA_STATE/given$1.env"
if [ -n "$ALULA_ROBOT_STATE" ] && [ -x "$ALULA_ROBOT_STATE/venv$1/bin/python3" ]; then
  _robot=$ALULA_ROBOT_STATE
  . "$_robot/robot.env"
  [ ! -f "$_robot/underlays$1.env" ] || . "$_robot/underlays$1.env"
fi
_below="${ALULA_UNDERLAYS:+$ALULA_UNDERLAYS:}"
export PATH="${_robot:+$_robot/venv$1/bin:}$ALULA_STATE/venv$1/bin:${ALULA_UNDERLAY_PROGRAMS:+$ALULA_UNDERLAY_PROGRAMS:}$_path"
case "$1" in
  1)
    export ROS_VERSION=1 ROS_PYTHON_VERSION=3 ROS_ETC_DIR="${ROS_ETC_DIR:-/etc/ros}"
    export ROS_PACKAGE_PATH="${_robot:+$_robot/ros1/src:}$ALULA_STATE/ros1/src:${ALULA_UNDERLAY_PACKAGES:+$ALULA_UNDERLAY_PACKAGES:}/usr/share"
    export CMAKE_PREFIX_PATH="${_robot:+$_robot/ros1/devel:}$ALULA_STATE/ros1/devel:$_below/usr"
    # As a workspace's own set-up does: nodes of Alula, which run under its Python, load the robot's messages by their names.
    [ -z "$_robot" ] || export PYTHONPATH="$_robot/ros1/devel/lib/python3/dist-packages"
    # The usual master where the caller exports none: `alula run` has to tell the two cases apart.
    [ -n "${ROS_MASTER_URI:-}" ] || export ROS_MASTER_URI=http://127.0.0.1:11311 ALULA_USUAL_MASTER=http://127.0.0.1:11311
    # Loopback, unless the caller has given this machine a name: roscpp takes no peers by name beside a loopback address.
    [ -n "${ROS_HOSTNAME:-}" ] || export ROS_IP="${ROS_IP:-127.0.0.1}"
    ;;
  2)
    export ROS_VERSION=2 ROS_DISTRO="${ROS_DISTRO:-jazzy}" ROS_PYTHON_VERSION=3
    export AMENT_PREFIX_PATH="${_robot:+$_robot/ros2/install:}$ALULA_STATE/ros2/install:$_below$ALULA_STATE/venv2"
    export CMAKE_PREFIX_PATH="$AMENT_PREFIX_PATH"
    # The wheels would start Python a second time to set the loader's path, and look for their libraries in the robot's environment.
    export LD_LIBRARY_PATH="${_robot:+$_robot/ros2/install/lib:}$ALULA_STATE/ros2/install/lib:${ALULA_UNDERLAY_LIBRARIES:+$ALULA_UNDERLAY_LIBRARIES:}$ALULA_STATE/venv2/lib"
    for _libraries in "$ALULA_STATE"/venv2/lib/python3*/site-packages/ros_*.libs; do
      [ ! -d "$_libraries" ] || LD_LIBRARY_PATH="$LD_LIBRARY_PATH:$_libraries"
    done
    export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
    export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
    export RMW_IMPLEMENTATION=rmw_fastrtps_cpp
    # Where the bridge finds ROS 1's definitions: the workspaces of the robot and of Alula, what ROS 1 stands on, and the caller's packages.
    _below="$(unset ALULA_UNDERLAY_PACKAGES
      for _file in "$ALULA_STATE/given1.env" "${_robot:-/dev}/underlays1.env"; do [ ! -f "$_file" ] || . "$_file"; done
      printf %s "${ALULA_UNDERLAY_PACKAGES:-}")"
    export ROS_BRIDGE_ROS1_WORKSPACES="${_robot:+$_robot/ros1/src:}$ALULA_STATE/ros1/src${_below:+:$_below}"
    [ -z "$_packages" ] || export ROS_PACKAGE_PATH="$_packages"
    # 64 MB shared-memory segments: the default of 512 kB loses images and makes them slow.
    export FASTRTPS_DEFAULT_PROFILES_FILE="${FASTRTPS_DEFAULT_PROFILES_FILE:-$ALULA_ROOT/bridge/fastdds.xml}"
    export FASTDDS_DEFAULT_PROFILES_FILE="$FASTRTPS_DEFAULT_PROFILES_FILE"
    ;;
  *) echo "env.sh: the world is 1 or 2, not '$1'" >&2; return 2 ;;
esac
unset _path _robot _below _libraries _packages ${!robot_@}
