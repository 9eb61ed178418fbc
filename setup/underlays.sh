#!/usr/bin/env bash
# Prints, as assignments of a shell, what is found through workspaces or prefixes that lie below Alula: underlays.sh DIR...
# Each is sourced as its own tools have written it, one after the other, in a shell that knows nothing of Alula.
set -u
[ $# -gt 0 ] || exit 0
plain=/usr/bin:/bin
if [ "${1:-}" != --sourced ]; then exec env -i PATH=$plain HOME="${HOME:-/}" "$BASH" "$0" --sourced "$@"; fi
shift
for folder in "$@"; do
  found=""
  for file in setup.bash local_setup.bash install/setup.bash devel/setup.bash; do
    [ -n "$found" ] || [ ! -f "$folder/$file" ] || found=$folder/$file
  done
  [ -n "$found" ] || { echo "error: the underlay $folder has no setup.bash: build it first, or name the folder above its install or devel space" >&2; exit 1; }
  set +u; . "$found" >&2 || exit 1; set -u
done
without() { # LIST PATH...: what is in a list between colons, but for some
  local list=$1 place kept=""; shift
  while IFS= read -r -d: place; do [ -z "$place" ] || [[ " $* " == *" $place "* ]] || kept="$kept:$place"; done <<<"$list:"
  printf '%q' "${kept#:}"
}
echo "export ALULA_UNDERLAYS=$(without "${AMENT_PREFIX_PATH:-}:${CMAKE_PREFIX_PATH:-}" /usr)"
echo "export ALULA_UNDERLAY_PROGRAMS=$(without "$PATH" ${plain//:/ })"
echo "export ALULA_UNDERLAY_PYTHON=$(without "${PYTHONPATH:-}" /usr/lib/python3/dist-packages)"
echo "export ALULA_UNDERLAY_LIBRARIES=$(without "${LD_LIBRARY_PATH:-}")"
echo "export ALULA_UNDERLAY_PACKAGES=$(without "${ROS_PACKAGE_PATH:-}" /usr/share)"
for name in ROS_DISTRO ROS_ETC_DIR ROS_ROOT; do [ -z "${!name:-}" ] || printf 'export %s=%q\n' "$name" "${!name}"; done
