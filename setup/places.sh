# Sourced: where the installation and the robot lie. ALULA_ROOT must be set; nothing of a robot is ever written there but the drone's own.
#   ALULA_STATE         what Alula's set-up made: two environments, the general ROS packages
#   ALULA_ROBOT         the robot that commands are about; the drone of this checkout, where the entry script has not looked for one
#   ALULA_ROBOT_STATE   what the robot's set-up made on top of it; empty where there is no robot
export ALULA_ROOT ALULA_STATE="${ALULA_STATE:-$ALULA_ROOT/.alula}"
export ALULA_ROBOT="${ALULA_ROBOT-$ALULA_ROOT}"
case "$ALULA_ROBOT" in
  "") ALULA_ROBOT_STATE="" ;;
  "$ALULA_ROOT") ALULA_ROBOT_STATE="$ALULA_STATE/robot" ;;
  *) ALULA_ROBOT_STATE="$ALULA_ROBOT/.alula" ;;
esac
export ALULA_ROBOT_STATE
