# Sourced: the environment of one ROS world in this shell, with nothing of the other.  usage: . setup/env.sh 1|2
# ALULA_ROOT must be set. The caller's ROS_MASTER_URI, ROS_DOMAIN_ID, ROS_LOG_DIR and display settings are kept.
unset PYTHONHOME AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH PYTHONPATH LD_LIBRARY_PATH ROS_PACKAGE_PATH ROS_ROOT ROS_DISTRO VIRTUAL_ENV
# The ROS 2 wheels set the loader's path once a process tree and mark that with this variable; we have just unset the path.
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE
export ALULA_ROOT ALULA_STATE="${ALULA_STATE:-$ALULA_ROOT/.alula}"
# The robot that commands are about (alula.common.robots); the drone of this checkout, where the entry script has not looked for one.
export ALULA_ROBOT="${ALULA_ROBOT-$ALULA_ROOT}"
export PYTHONUNBUFFERED=1 PYTHONNOUSERSITE=1
# Numeric libraries: many small processes share few cores, a pool of threads in each only makes them wait for one another.
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}" OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}"
export MPLBACKEND=Agg
_alula_path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
case "$1" in
  1)
    export PATH="$ALULA_STATE/venv1/bin:$_alula_path"
    export ROS_VERSION=1 ROS_PYTHON_VERSION=3 ROS_ETC_DIR=/etc/ros
    export ROS_PACKAGE_PATH="$ALULA_ROOT/ros1_ws/src:/usr/share"
    export CMAKE_PREFIX_PATH="$ALULA_STATE/ros1/devel:/usr"
    export ROS_MASTER_URI="${ROS_MASTER_URI:-http://127.0.0.1:11311}"
    # Loopback, unless the caller has given this machine a name: roscpp takes no peers by name beside a loopback address.
    [ -n "${ROS_HOSTNAME:-}" ] || export ROS_IP="${ROS_IP:-127.0.0.1}"
    ;;
  2)
    export PATH="$ALULA_STATE/venv2/bin:$_alula_path"
    _alula_install="$ALULA_STATE/ros2/install"
    export ROS_VERSION=2 ROS_DISTRO=jazzy ROS_PYTHON_VERSION=3
    export AMENT_PREFIX_PATH="$_alula_install:$ALULA_STATE/venv2"
    export CMAKE_PREFIX_PATH="$_alula_install:$ALULA_STATE/venv2"
    export LD_LIBRARY_PATH="$_alula_install/lib"
    export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
    export RMW_IMPLEMENTATION=rmw_fastrtps_cpp
    # 64 MB shared-memory segments: the default of 512 kB loses images and makes them slow.
    export FASTRTPS_DEFAULT_PROFILES_FILE="${FASTRTPS_DEFAULT_PROFILES_FILE:-$ALULA_ROOT/bridge/fastdds.xml}"
    export FASTDDS_DEFAULT_PROFILES_FILE="$FASTRTPS_DEFAULT_PROFILES_FILE"
    ;;
  *) echo "env.sh: the world is 1 or 2, not '$1'" >&2; return 2 ;;
esac
unset _alula_path _alula_install
